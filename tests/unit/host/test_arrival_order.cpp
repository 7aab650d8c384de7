// SPDX-License-Identifier: MIT
// Frames without a counter as adapters hand them over: several at a time under one stamp, equal values, behind stalls that
// are made up for, beside a punctual bus, from polls up to 2 kHz. The next frame is the next sample, and what was lost is
// told from what was late. The delays here are drawn by other laws than the code has in mind (uniform, bimodal, ramps).
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

/// Logs of two identifiers, so many frames at a time under one stamp, joined anywhere.
static void test_frames_of_one_read_stay_together() {
    for (const int together : {2, 4, 8, 16, 5, 7})
        for (const int first : {0, 1, 3}) {
            const live_config config = make_config(1000, {0, 0});
            rows out(2);
            grid on(config, out);
            std::vector<drv_frame_t> batch;
            int size = first ? first : together;
            for (int n = 0; n < 5000; ++n)
                for (std::size_t c = 0; c < 2; ++c) {
                    batch.push_back(make_frame(c, 0, n, 0));
                    if (static_cast<int>(batch.size()) < size) continue;
                    size = together;
                    for (drv_frame_t& frame : batch) {
                        frame.time_ns =
                            day_ns + std::int64_t{n} * 1000000 + 300000 + static_cast<std::int64_t>(c) * 100000;
                        on.push(frame);
                    }
                    batch.clear();
                }
            on.finish();
            char text[60];
            std::snprintf(text, sizeof text, "%d at a time, the first %d", together, first);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.unlike, text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.torn, text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.marked, text);
            TEST_ASSERT_TRUE_MESSAGE(out.at >= 4990, text);
        }
}

/// So many frames a read, and the stream begins behind the first, second, … of them, in the midst of a sample: reads that end
/// with the last channel of a sample, or with each of them, tell where samples begin.
static void test_a_stream_that_begins_anywhere() {
    for (const int channels : {2, 3})
        for (const int samples : {1, 2, 8})
            for (const int more : {0, 1}) // a frame more: then reads end anywhere
                for (int begin = 0; begin < 2 * channels; ++begin) {
                    const live_config config =
                        make_config(1000, std::vector<std::size_t>(static_cast<std::size_t>(channels), 0));
                    rows out(static_cast<std::size_t>(channels));
                    grid on(config, out);
                    std::vector<drv_frame_t> batch;
                    for (int k = 0; k < 3000 * channels; ++k) {
                        const int n = k / channels, c = k % channels;
                        batch.push_back(make_frame(static_cast<std::size_t>(c), 0, n, n * 1e-3 + c * 0.05e-3));
                        if (static_cast<int>(batch.size()) < samples * channels + more) continue;
                        for (drv_frame_t& frame : batch) {
                            frame.time_ns = batch.back().time_ns + 20000;
                            if (k >= samples * channels + more || &frame - batch.data() >= begin) on.push(frame);
                        }
                        batch.clear();
                    }
                    on.finish();
                    char text[80];
                    std::snprintf(text, sizeof text, "%d channels, %d samples and %d a read, from frame %d", channels,
                                  samples, more, begin);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.unlike, text);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.torn, text);
                    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.marked, text);
                }
}

/// A hammer at rest sends the same number for ever.
static void test_equal_values_are_samples() {
    const live_config config = make_config(1000, {0, 0});
    rows out(2);
    grid on(config, out);
    for (int n = 0; n < 10000; ++n)
        for (std::size_t c = 0; c < 2; ++c) on.push(make_frame(c, 0, 7, std::ceil((n + 1) / 16.0) * 0.016));
    on.finish();
    TEST_ASSERT_TRUE(out.at >= 9984);
    TEST_ASSERT_EQUAL_INT64(0, out.marked);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(0).duplicate);
}

/// A line that hands its samples over in bursts beside a punctual bus: no channel is late by a sample.
static void test_bursts_beside_a_punctual_bus() {
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const live_config config = make_config(1000, {0, 1});
        rows out(2);
        grid on(config, out);
        const double every_s = seed % 2 ? 0.0161 : 0.00805, join_s = pick(random, 0, 0.02);
        const law line = polled(every_s, 0.15e-3, pick(random, 0, 1), random);
        std::vector<drv_frame_t> frames;
        for (int n = 0; n < 6000; ++n) {
            const double t = 1 + n * 1e-3;
            if (t > 1 + join_s) frames.push_back(make_frame(0, 0, n, t + 0.1e-3 * pick(random, 0, 1)));
            frames.push_back(make_frame(1, 1, n, line(t)));
        }
        std::stable_sort(frames.begin(), frames.end(),
                         [](const drv_frame_t& a, const drv_frame_t& b) { return a.time_ns < b.time_ns; });
        for (const drv_frame_t& frame : frames) on.push(frame);
        on.finish();
        char text[40];
        std::snprintf(text, sizeof text, "seed %u", seed);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.unlike, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.marked, text);
    }
}

/// Stalls of 0.1 to 5 s anywhere, made up for at once or at 1.2 to 20 times the rate: nothing is missing.
static void test_stalls_make_no_gap() {
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 4>{100, 200, 1000, 2000}[random() % 4];
        std::vector<stall> stalls;
        double t = pick(random, 0, 4);
        while (t < 26) {
            const double length_s = 0.1 * std::pow(50, pick(random, 0, 1));
            const double faster = random() % 3 ? 0 : pick(random, 1.2, 20);
            stalls.push_back({t, length_s, faster});
            t += length_s * (faster > 0 ? 1 + 1 / (faster - 1) : 1) + pick(random, 0.2, 6);
        }
        const law usual = scheduled(0.3e-3, 4e-3, 0.05, random);
        rows out(1);
        const int samples = static_cast<int>(30 * rate_hz);
        play(rate_hz, pick(random, -100, 100), samples, behind(stalls, usual), {}, out);
        char text[80];
        std::snprintf(text, sizeof text, "seed %u, %g Hz, %zu stalls", seed, rate_hz, stalls.size());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.marked, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.torn, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(samples, out.at, text);
    }
}

/// Streams that end anywhere, in bursts, behind a stall, or while one is made up for: nothing is missing at the end.
static void test_any_end() {
    std::int64_t runs = 0, runs_false = 0;
    for (const double rate_hz : {200.0, 800.0, 1000.0, 2000.0})
        for (const double every_s : {0.0, 0.008, 0.016, 0.032})
            for (unsigned seed = 1; seed <= 3 * seeds() / 5; ++seed) {
                std::mt19937 random(seed);
                const double end_s = pick(random, 3, 6);
                std::vector<stall> stalls;
                for (double t = pick(random, 0.5, 2); seed % 3 == 1 && t < end_s; t += pick(random, 0.5, 2))
                    stalls.push_back({t, random() % 2 ? 0.15 : 0.3, 0});
                const double length_s = pick(random, 0.05, 0.5);
                if (seed % 3 == 2)
                    stalls.push_back({end_s - length_s - pick(random, 0, 0.5), length_s, pick(random, 1.2, 20)});
                rows out(1);
                const law usual = every_s > 0 ? polled(every_s, 0.2e-3, pick(random, 0, 1), random)
                                              : scheduled(0.3e-3, 4e-3, 0.05, random);
                play(rate_hz, pick(random, -60, 60), static_cast<int>(end_s * rate_hz), behind(stalls, usual), {}, out);
                ++runs;
                runs_false += out.marked > 0;
            }
    std::printf("ends: %lld of %lld with a false gap\n", static_cast<long long>(runs_false),
                static_cast<long long>(runs));
    TEST_ASSERT_TRUE(runs_false <= runs / 5000); // none of the usual 1,440
}

/// Polls of 16 and 32 ms up to 2 kHz: nothing is missing, and of the losses at least 99 % are found. Where every poll ends
/// alike (1 and 2 kHz), a single one cannot be told from a poll that slips past a sample: then it is uncertain.
static void test_polls_and_losses() {
    std::array<std::int64_t, 2> made{}, found{}; // to 800 Hz, above
    std::int64_t told = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 5>{100, 200, 800, 1000, 2000}[random() % 5];
        const double every_s = random() % 2 ? 0.016 : 0.032;
        const double phase = pick(random, 0, 1), ppm = pick(random, -60, 60);
        const int samples = static_cast<int>(30 * rate_hz);
        char text[80];
        std::snprintf(text, sizeof text, "seed %u, %g Hz, every %g s, %.1f ppm", seed, rate_hz, every_s, ppm);
        rows clean(1);
        play(rate_hz, ppm, samples, polled(every_s, 0.2e-3, phase, random), {}, clean);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, clean.marked, text);
        std::set<int> lost;
        const int count = 1 + static_cast<int>(random() % 3);
        for (int i = 0; i < count; ++i)
            lost.insert(static_cast<int>((1 + 28.0 * (i + pick(random, 0.05, 0.95)) / count) * rate_hz));
        rows out(1);
        play(rate_hz, ppm, samples, polled(every_s, 0.2e-3, phase, random), lost, out);
        const bool fast = rate_hz > 800;
        made[fast] += static_cast<std::int64_t>(lost.size());
        found[fast] += std::min<std::int64_t>(out.marked, static_cast<std::int64_t>(lost.size()));
        told += std::min<std::int64_t>(out.marked + out.uncertain, fast ? static_cast<std::int64_t>(lost.size()) : 0);
        if (!fast && out.marked == static_cast<std::int64_t>(lost.size()))
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.uncertain, text);
    }
    std::printf("polls: %lld of %lld losses found, above 800 Hz %lld, or uncertain %lld, of %lld\n",
                static_cast<long long>(found[0]), static_cast<long long>(made[0]), static_cast<long long>(found[1]),
                static_cast<long long>(told), static_cast<long long>(made[1]));
    TEST_ASSERT_TRUE(static_cast<double>(told) >= 0.97 * static_cast<double>(made[1])); // a slip back hides one
    TEST_ASSERT_TRUE(static_cast<double>(found[0]) >= 0.99 * static_cast<double>(made[0]));
}

/// Adapters that look by a clock of their own, late by what a gamma law gives, at sensors that run up to 200 ppm off: several
/// samples a look. Polls slip past samples all the time; that is no loss.
static void test_slips_are_no_losses() {
    std::int64_t wrong = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 7>{97, 200, 500, 800, 1000, 1600, 2000}[random() % 7];
        const double every_s = std::array<double, 4>{0.01, 0.016, 0.032, 0.005}[random() % 4];
        if (every_s * rate_hz < 1.5) continue;
        std::gamma_distribution<double> way(2, random() % 2 ? 25e-6 : 150e-6), cut(1.5, random() % 2 ? 1e-9 : 33e-6);
        const double clock = every_s * (1 + 1e-6 * pick(random, -100, 100));
        double look_s = pick(random, 0, clock), cut_s = look_s, here_s = look_s;
        const law usual = [&](double t) {
            while (cut_s < t) {
                look_s += clock;
                cut_s = look_s + cut(random);
                here_s = cut_s + way(random);
            }
            return here_s;
        };
        rows out(1);
        play(rate_hz, pick(random, -200, 200), static_cast<int>(30 * rate_hz), usual, {}, out);
        wrong += out.marked > 0 || out.torn > 0;
    }
    std::printf("slips: %lld of %u runs with a false gap\n", static_cast<long long>(wrong), seeds());
    TEST_ASSERT_TRUE(static_cast<double>(wrong) <= 0.01 * seeds());
}

/// A sample that never reached an adapter which hands over so many at a time: no packet is short, all are later.
static void test_packets_that_lack_a_sample() {
    for (unsigned seed = 1; seed <= seeds() / 2; ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 4>{97, 333, 1000, 1600}[random() % 4];
        const int size = std::array<int, 4>{3, 8, 10, 16}[random() % 4], samples = static_cast<int>(20 * rate_hz);
        const int at = static_cast<int>(pick(random, 5, 15) * rate_hz);
        std::gamma_distribution<double> way(2, 0.02 / rate_hz);
        double here_s = 0;
        int packet = -1;
        const law usual = [&](double t) { // of the samples that came; the missing one asks, too, and is not sent
            const int n = static_cast<int>(std::lround(t * rate_hz)), count = n - (n > at),
                      last = (count / size + 1) * size - 1;
            if (count / size != packet) here_s = (last + (last >= at)) / rate_hz + way(random);
            packet = count / size;
            return here_s;
        };
        rows out(1);
        play(rate_hz, 0, samples, usual, {at}, out);
        char text[60];
        std::snprintf(text, sizeof text, "seed %u, %g Hz, packets of %d", seed, rate_hz, size);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(1, out.marked, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.uncertain, text);
    }
}

/// Packets of eight lines that are lost behind such polls: each is found, to the sample.
static void test_lost_packets() {
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        const double rate_hz = std::array<double, 3>{800, 1000, 2000}[random() % 3],
                     every_s = random() % 2 ? 0.016 : 0.032;
        std::set<int> lost;
        for (double t = pick(random, 1, 2); t < 14; t += pick(random, 1.5, 5))
            for (int i = 0; i < 8; ++i) lost.insert(static_cast<int>(t * rate_hz) + i);
        rows out(1);
        play(rate_hz, 0, static_cast<int>(16 * rate_hz), polled(every_s, 0.2e-3, pick(random, 0, 1), random), lost,
             out);
        char text[60];
        std::snprintf(text, sizeof text, "seed %u, %g Hz, every %g s", seed, rate_hz, every_s);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost.size(), out.marked, text);
    }
}

/// Losses on a bus that delivers frame by frame, among stalls that are made up for.
static void test_losses_among_stalls() {
    std::int64_t made = 0, wrong = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        std::mt19937 random(seed);
        std::vector<stall> stalls;
        for (double t = pick(random, 1, 3); t < 26; t += pick(random, 2, 6))
            stalls.push_back({t, pick(random, 0.1, 0.6), 0});
        std::set<int> lost;
        for (double t = 1.5; t < 28; t += pick(random, 1.5, 4)) lost.insert(static_cast<int>(t * 1000));
        rows out(1);
        play(1000, pick(random, -100, 100), 30000, behind(stalls, scheduled(0.3e-3, 4e-3, 0.02, random)), lost, out);
        made += static_cast<std::int64_t>(lost.size());
        wrong += std::abs(out.marked - static_cast<std::int64_t>(lost.size()));
    }
    std::printf("stalls: %lld losses, number wrong by %lld\n", static_cast<long long>(made),
                static_cast<long long>(wrong));
    TEST_ASSERT_TRUE(static_cast<double>(wrong) <= 0.01 * static_cast<double>(made));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_frames_of_one_read_stay_together);
    RUN_TEST(test_a_stream_that_begins_anywhere);
    RUN_TEST(test_equal_values_are_samples);
    RUN_TEST(test_bursts_beside_a_punctual_bus);
    RUN_TEST(test_stalls_make_no_gap);
    RUN_TEST(test_any_end);
    RUN_TEST(test_polls_and_losses);
    RUN_TEST(test_slips_are_no_losses);
    RUN_TEST(test_packets_that_lack_a_sample);
    RUN_TEST(test_lost_packets);
    RUN_TEST(test_losses_among_stalls);
    return UNITY_END();
}
