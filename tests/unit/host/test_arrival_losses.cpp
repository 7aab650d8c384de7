// SPDX-License-Identifier: MIT
// Losses of frames without a counter, found or counted as uncertain, and the same runs without a loss: adapters that hand over
// one sample a poll, and everything mixed. Polls follow a clock of their own; whether a sample is in time for its poll is
// chance near the border (normal), which the code does not know.
#include "arrival_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>
#include <set>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

/// An adapter that looks at k * every_s, give or take, and hands over what has come; on its way that is late by a gamma law,
/// and now and then by up to three looks.
law looks(double every_s, double cut_s, double way_s, double held_up, std::mt19937& random) {
    struct state {
        double at, cut = 0, here = 0;
        std::normal_distribution<double> border{0, 1};
        std::gamma_distribution<double> way{2, 1};
    };
    const auto now = std::make_shared<state>(state{-every_s * pick(random, 1, 2)});
    return [=, &random](double t) {
        while (now->here == 0 || now->cut < t) {
            now->at += every_s;
            now->cut = now->at + cut_s * now->border(random);
            const double more_s = pick(random, 0, 1) < held_up ? every_s * pick(random, 0.2, 3) : 0;
            now->here = now->cut + way_s * now->way(random) + more_s;
        }
        return now->here;
    };
}

struct lost_run {
    int first, count;
};

struct tally {
    std::int64_t runs = 0, false_runs = 0, false_gaps = 0, made = 0, found = 0, told = 0;

    /// A loss is found where gaps of its size together, give or take one, begin within `near` of it, or may by their own bound; else at least told of.
    void judge(const rows& out, const std::vector<grid_gap>& gaps, const std::vector<lost_run>& lost, int near,
               std::int64_t uncertain_else) {
        std::int64_t open = 0;
        for (const lost_run& each : lost) {
            std::int64_t marked = 0;
            for (const grid_gap& gap : gaps)
                if (gap.first <= each.first + near && gap.first + gap.within >= each.first - near) marked += gap.count;
            const bool hit = marked > 0 && std::abs(marked - each.count) <= 1;
            ++made;
            found += hit;
            open += !hit;
        }
        told +=
            static_cast<std::int64_t>(lost.size()) - std::max<std::int64_t>(0, open - out.uncertain + uncertain_else);
    }
};

struct rows_and_gaps : rows {
    rows_and_gaps() : rows(1) {}
    std::vector<grid_gap> gaps;
    void on_gap(const grid_gap& gap) override {
        rows::on_gap(gap);
        gaps.push_back(gap);
    }
};

std::set<int> samples_of(const std::vector<lost_run>& lost) {
    std::set<int> out;
    for (const lost_run& each : lost)
        for (int i = 0; i < each.count; ++i) out.insert(each.first + i);
    return out;
}

} // namespace

/// One sample a poll, and a sensor 50 to 200 ppm off the polls: a poll slips past a sample every 5,000 to 20,000. Before it does
/// so for good, some do and some do not; before a loss there is no such flicker.
static void test_one_sample_a_poll() {
    tally sum;
    std::int64_t slips = 0;
    const unsigned runs = std::max(50U, seeds() / 3); // the bound below is for 100 losses, under a sanitizer too
    for (unsigned seed = 1; seed <= runs; ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 4>{100, 200, 500, 1000}[random() % 4];
        const double ppm = (random() % 2 ? 1 : -1) * pick(random, 50, 200);
        const double border = 2e-3 * std::pow(10, pick(random, 0, 1)), way = pick(random, 0.005, 0.03);
        const double held_up = seed % 3 ? 0.0005 : 0.01;
        const int samples = 60000;
        std::vector<double> arrivals;
        const law usual = looks(1 / rate_hz, border / rate_hz, way / rate_hz, held_up, random);
        for (int n = 0; n < samples; ++n) arrivals.push_back(usual(n / rate_hz * (1 + 1e-6 * ppm)));
        const law again = [&](double t) { return arrivals[static_cast<std::size_t>(std::lround(t * rate_hz))]; };
        rows_and_gaps clean;
        play(rate_hz, 0, samples, again, {}, clean);
        ++sum.runs;
        sum.false_runs += clean.marked > 0;
        sum.false_gaps += static_cast<std::int64_t>(clean.gaps.size());
        slips += static_cast<std::int64_t>(samples * 1e-6 * std::abs(ppm));
        std::vector<lost_run> lost;
        for (int i = 0, count = 1 + static_cast<int>(random() % 3); i < count; ++i)
            lost.push_back({static_cast<int>(samples * (0.05 + 0.9 * (i + pick(random, 0.05, 0.95)) / count)), 1});
        rows_and_gaps out;
        play(rate_hz, 0, samples, again, samples_of(lost), out);
        sum.judge(out, out.gaps, lost, 40 + static_cast<int>(rate_hz / 5), clean.uncertain);
    }
    std::printf(
        "one sample a poll: %lld slips, %lld of them a gap, in %lld of %lld runs; %lld of %lld losses found, %lld "
        "found or uncertain\n",
        static_cast<long long>(slips), static_cast<long long>(sum.false_gaps), static_cast<long long>(sum.false_runs),
        static_cast<long long>(sum.runs), static_cast<long long>(sum.found), static_cast<long long>(sum.made),
        static_cast<long long>(sum.told));
    TEST_ASSERT_TRUE(sum.false_gaps <= slips / 100);
    TEST_ASSERT_TRUE(static_cast<double>(sum.told) >= 0.94 * static_cast<double>(sum.made));
}

/// Everything: 97 Hz to 2 kHz, 200 ppm off, frame by frame, polls of 1 to 32 ms, packets of 3 to 16, stalls in 40 of 100 runs,
/// losses of 1 to 600 samples at least a second from either end.
static void test_losses_of_all_kinds() {
    tally sum;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 8>{97, 100, 200, 333, 500, 800, 1000, 2000}[random() % 8];
        const double ppm = pick(random, -200, 200), length_s = 24;
        const int samples = static_cast<int>(length_s * rate_hz), size = 3 + static_cast<int>(random() % 14);
        const double every_s = std::array<double, 6>{0.001, 0.002, 0.004, 0.008, 0.016, 0.032}[random() % 6];
        std::gamma_distribution<double> way(2, 0.03 / rate_hz);
        law usual = scheduled(0.3e-3, 4e-3, 0.02, random);
        const auto kind = random() % 3;
        if (kind == 1)
            usual =
                looks(every_s * (1 + 1e-6 * pick(random, -100, 100)), 5e-6 + 2e-3 * every_s, 0.05e-3, 0.002, random);
        if (kind == 2)
            usual = [&, handed = -1, here_s = 0.0](double t) mutable {
                const int n = static_cast<int>(t * rate_hz / (1 + 1e-6 * ppm) + 0.5) / size;
                if (n != handed) here_s = ((n + 1) * size - 1) / rate_hz * (1 + 1e-6 * ppm) + way(random);
                handed = n;
                return here_s;
            };
        std::vector<stall> stalls;
        if (seed % 5 < 2)
            for (double t = pick(random, 1, 8); t < length_s; t += pick(random, 7, 12))
                stalls.push_back({t, 0.1 * std::pow(50, pick(random, 0, 1)), random() % 2 ? 0 : pick(random, 1.5, 20)});
        usual = behind(stalls, usual);
        std::vector<double> arrivals;
        for (int n = 0; n < samples; ++n) arrivals.push_back(usual(n / rate_hz * (1 + 1e-6 * ppm)));
        const law again = [&](double t) { return arrivals[static_cast<std::size_t>(std::lround(t * rate_hz))]; };
        rows_and_gaps clean;
        play(rate_hz, 0, samples, again, {}, clean);
        ++sum.runs;
        sum.false_runs += clean.marked > 0;
        std::vector<lost_run> lost;
        for (int i = 0, count = 1 + static_cast<int>(random() % 2); i < count; ++i) {
            const double at_s = 1 + (length_s - 2) * (i + pick(random, 0.1, 0.6)) / count;
            lost.push_back({static_cast<int>(at_s * rate_hz),
                            std::min(static_cast<int>(std::pow(600, pick(random, 0, 1))), static_cast<int>(rate_hz))});
        }
        rows_and_gaps out;
        play(rate_hz, 0, samples, again, samples_of(lost), out);
        sum.judge(out, out.gaps, lost, static_cast<int>(rate_hz), 0);
    }
    std::printf("all kinds: %lld of %lld runs with a false gap; %lld of %lld losses found, %lld found or uncertain\n",
                static_cast<long long>(sum.false_runs), static_cast<long long>(sum.runs),
                static_cast<long long>(sum.found), static_cast<long long>(sum.made), static_cast<long long>(sum.told));
    TEST_ASSERT_TRUE(static_cast<double>(sum.false_runs) <= 0.01 * static_cast<double>(sum.runs));
    TEST_ASSERT_TRUE(static_cast<double>(sum.told) >= 0.99 * static_cast<double>(sum.made));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_one_sample_a_poll);
    RUN_TEST(test_losses_of_all_kinds);
    return UNITY_END();
}
