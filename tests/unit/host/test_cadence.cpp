// SPDX-License-Identifier: MIT
// A sensor without a counter (WitMotion, VectorNav): its packets reach the host in bursts, behind a latency timer, late by
// a scheduler. Every sample is placed, no gap that was not, and what was lost is marked to the sample.
#include "grid_frames.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <set>
#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

live_config make_config(double rate_hz) {
    live_config config = lanes_of(1, 0, rate_hz);
    config.channels[0].layout = bits_at(0, 32);
    return config;
}

struct recorder : grid_sink {
    std::vector<std::int64_t> rows; ///< the sample in each row, -1 = missing
    std::array<std::int64_t, 6> by{};
    void on_sample(std::int64_t, const double* row) override {
        rows.push_back(row[0] == row[0] ? static_cast<std::int64_t>(row[0]) : -1);
    }
    void on_missing(std::int64_t, std::int64_t count) override {
        rows.insert(rows.end(), static_cast<std::size_t>(count), -1);
    }
    void on_gap(const grid_gap& gap) override { by[static_cast<std::size_t>(gap.cause)] += gap.count; }
    std::int64_t marked() const {
        std::int64_t sum = 0;
        for (const std::int64_t count : by) sum += count;
        return sum;
    }
    /// Rows whose sample stands elsewhere, at most so many samples off for `most` to hold.
    std::int64_t displaced(std::int64_t& most) const {
        std::int64_t count = 0;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const std::int64_t off = rows[i] < 0 ? 0 : std::abs(rows[i] - rows[0] - static_cast<std::int64_t>(i));
            count += off != 0;
            most = std::max(most, off);
        }
        return count;
    }
};

/// A sensor of this rate seen by a host that gets to hear of the sample of time t at arrival(t).
struct sensor {
    double rate_hz, ppm = 0;
    std::function<double(double)> arrival;
    std::set<int> lost;
    bool told = false; ///< the line says before which packet something was lost
};

void play(const sensor& s, int samples, recorder& out, std::uint64_t* doubled = nullptr) {
    const live_config config = make_config(s.rate_hz);
    grid on(config, out);
    double heard_s = 0;
    std::uint8_t loss = 0;
    for (int n = 0; n < samples; ++n) {
        if (s.lost.count(n)) {
            loss = s.told ? DRV_LOSS_CRC : 0;
            continue;
        }
        drv_frame_t frame{};
        frame.id = 0x100;
        frame.len = 4;
        frame.loss = loss;
        loss = 0;
        for (int i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(n >> 8 * i);
        heard_s = std::max(heard_s + 2e-6, s.arrival(n / s.rate_hz * (1 + 1e-6 * s.ppm))); // in order, 2 us apart
        frame.time_ns = day_ns + std::llround(heard_s * 1e9);
        on.push(frame);
    }
    on.finish();
    if (doubled) *doubled = on.bus(0).duplicate + on.bus(0).out_of_order;
}

/// The host looks every `every_s`, and is late by an exponential delay.
std::function<double(double)> bursts(double every_s, double late_s, std::mt19937& random) {
    return [every_s, late_s, &random](double t) {
        std::exponential_distribution<double> late(1.0);
        return (std::ceil(t / every_s - 0.37) + 0.37) * every_s + late_s * late(random);
    };
}

std::set<int> some_lost(std::mt19937& random, int samples, int most) {
    std::set<int> lost;
    for (int n = 600; n < samples - 600; n += 300 + static_cast<int>(random() % 300))
        for (int i = 0; i < 1 + static_cast<int>(random() % static_cast<unsigned>(most)); ++i) lost.insert(n + i);
    return lost;
}

struct burst_case {
    double rate_hz, every_s, late_s, ppm;
};
const burst_case cases[] = {
    {200, 0.040, 0.2e-3, 0},   {200, 0.016, 0.3e-3, 40},  {100, 0.001, 0.5e-3, -80}, {800, 0.004, 0.1e-3, 100},
    {1000, 0.016, 0.1e-3, 30}, {500, 0.001, 0.1e-3, 500}, {50, 0.016, 2e-3, 100},    {1000, 0.001, 0.05e-3, -50},
};

} // namespace

static void test_bursts_make_no_gap() {
    for (unsigned seed = 1; seed <= 20; ++seed)
        for (const burst_case& c : cases) {
            std::mt19937 random(seed);
            recorder out;
            std::uint64_t doubled = 0;
            std::int64_t most = 0;
            play({c.rate_hz, c.ppm, bursts(c.every_s, c.late_s, random), {}, false}, 20000, out, &doubled);
            char text[120];
            std::snprintf(text, sizeof text, "seed %u, %g Hz, every %g s", seed, c.rate_hz, c.every_s);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.marked(), text);
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, doubled, text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(20000, out.rows.size(), text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.displaced(most), text);
        }
}

/// Which packet of a burst is missing cannot be seen; that one is, can, and no sample is off by more than was lost.
static void test_losses_in_bursts_are_counted() {
    for (unsigned seed = 1; seed <= 20; ++seed)
        for (const burst_case& c : cases) {
            if (c.every_s * c.rate_hz == 1) continue; // a poll a sample: one that slips past a sample looks like a loss
            std::mt19937 random(seed);
            sensor s{c.rate_hz, c.ppm, bursts(c.every_s, c.late_s, random), some_lost(random, 20000, 3), false};
            recorder out;
            std::uint64_t doubled = 0;
            play(s, 20000, out, &doubled);
            std::int64_t most = 0;
            out.displaced(most);
            char text[120];
            std::snprintf(text, sizeof text, "seed %u, %g Hz, every %g s, %zu lost, off by %d", seed, c.rate_hz,
                          c.every_s, s.lost.size(), static_cast<int>(most));
            TEST_ASSERT_EQUAL_INT64_MESSAGE(static_cast<std::int64_t>(s.lost.size()), out.marked(), text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(20000, out.rows.size(), text);
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, doubled, text);
            TEST_ASSERT_TRUE_MESSAGE(most <= 3, text);
        }
}

/// A check sum that failed tells the place within the burst.
static void test_damaged_packets_are_missing_where_they_were() {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        std::mt19937 random(seed);
        sensor s{200, 0, bursts(0.040, 0.1e-3, random), some_lost(random, 20000, 1), true};
        recorder out;
        play(s, 20000, out);
        std::int64_t most = 0;
        const std::string text = "seed " + std::to_string(seed);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.displaced(most), text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(20000, out.rows.size(), text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(static_cast<std::int64_t>(s.lost.size()),
                                        out.by[static_cast<std::size_t>(gap_cause::crc)], text.c_str());
    }
}

/// The reader slept for a second; then all of it comes at once.
static void test_a_long_stall_is_no_gap() {
    for (const double rate : {100.0, 200.0, 1000.0}) {
        std::mt19937 random(7);
        const auto usual = bursts(0.016, 0.1e-3, random);
        recorder out;
        play({rate, 20, [&](double t) { return usual(t > 10 && t < 11 ? 11.0 : t); }, {}, false},
             static_cast<int>(rate * 30), out);
        std::int64_t most = 0;
        TEST_ASSERT_EQUAL_INT64(0, out.marked());
        TEST_ASSERT_EQUAL_INT64(0, out.displaced(most));
    }
}

/// Unplugged for some seconds: as many samples are missing as the time holds.
static void test_a_pause_is_a_gap_of_its_length() {
    std::mt19937 random(3);
    sensor s{200, 30, bursts(0.016, 0.1e-3, random), {}, false};
    for (int n = 4000; n < 5234; ++n) s.lost.insert(n);
    recorder out;
    play(s, 10000, out);
    std::int64_t most = 0;
    TEST_ASSERT_EQUAL_INT64(1234, out.marked());
    TEST_ASSERT_EQUAL_INT64(0, out.displaced(most));
    TEST_ASSERT_EQUAL_INT64(1234, out.by[static_cast<std::size_t>(gap_cause::stall)]);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_bursts_make_no_gap);
    RUN_TEST(test_losses_in_bursts_are_counted);
    RUN_TEST(test_damaged_packets_are_missing_where_they_were);
    RUN_TEST(test_a_long_stall_is_no_gap);
    RUN_TEST(test_a_pause_is_a_gap_of_its_length);
    return UNITY_END();
}
