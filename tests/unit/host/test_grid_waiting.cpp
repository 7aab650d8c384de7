// SPDX-License-Identifier: MIT
// How long a sample waits: for a silent lane, for the memory there is, and for a loss without a counter to be
// believed. And what a stream without any jitter tells: each loss at its place, with its cause, and how well the place
// is known.
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

drv_frame_t make_frame(const live_config& config, std::size_t lane, std::int64_t sample, double at_s) {
    return lane_frame(config, lane, sample, sample, std::llround(at_s * 1e9));
}

struct recorder : grid_sink {
    std::size_t width = 0;
    std::int64_t rows = 0, wrong = 0, holes = 0;
    std::vector<grid_gap> gaps;
    void on_sample(std::int64_t index, const double* row) override {
        wrong += index != rows++;
        for (std::size_t i = 0; i < width; ++i) {
            holes += row[i] != row[i];
            wrong += row[i] == row[i] && static_cast<std::int64_t>(row[i]) != index;
        }
    }
    void on_missing(std::int64_t, std::int64_t count) override {
        rows += count;
        holes += count * static_cast<std::int64_t>(width);
    }
    void on_gap(const grid_gap& gap) override { gaps.push_back(gap); }
};

} // namespace

/// Six seconds at 1 kHz are 6000 samples. Then it is gone, and nothing waits for it until it is back.
static void test_a_silent_lane_is_waited_for_six_seconds(void) {
    const live_config config = lanes_of(2, 32);
    recorder out;
    out.width = 2;
    grid on(config, out);
    const auto send = [&](std::size_t lane, std::int64_t n) {
        on.push(make_frame(config, lane, n, static_cast<double>(n) * 1e-3));
    };
    for (std::int64_t n = 0; n < 9000; ++n) {
        send(0, n);
        if (n < 1000 || n >= 8000) send(1, n);
        const std::int64_t gone = n < 8000 ? n : n + 1;
        if (n >= 1000) TEST_ASSERT_EQUAL_INT64(n < 7000 ? 1000 : gone, on.emitted());
    }
    on.finish();
    TEST_ASSERT_EQUAL_INT64(0, out.wrong);
    TEST_ASSERT_EQUAL_INT64(9000, out.rows);
    TEST_ASSERT_EQUAL_INT64(7000, out.holes);
    TEST_ASSERT_EQUAL_UINT64(1, out.gaps.size());
    TEST_ASSERT_EQUAL_INT64(1000, out.gaps[0].first);
    TEST_ASSERT_EQUAL_INT64(7000, out.gaps[0].count);
}

/// Of many channels at a high rate fewer samples wait. The ring has at most four times as many rows, and
/// most_rows_bytes.
static void test_samples_wait_as_far_as_there_is_memory(void) {
    constexpr std::size_t lanes = 100;
    const live_config config = lanes_of(lanes, 32, 10000);
    recorder out;
    out.width = lanes;
    grid on(config, out);
    std::int64_t waited = 0;
    for (std::int64_t n = 0; n < 60000 && waited == 0; ++n) {
        for (std::size_t lane = 0; lane < lanes; ++lane)
            if (n < 100 || lane != 17) on.push(make_frame(config, lane, n, static_cast<double>(n) * 1e-4));
        if (n > 100 && on.emitted() > 100) waited = n - 100;
    }
    const double row_bytes = 8 * (lanes + 2) + lanes; // numbers, stamp and count, and which lanes are there
    TEST_ASSERT_TRUE(4 * row_bytes * static_cast<double>(waited) <= most_rows_bytes);
    TEST_ASSERT_TRUE(4 * row_bytes * static_cast<double>(waited + 2) > most_rows_bytes);
    TEST_ASSERT_EQUAL_INT64(0, out.wrong);
}

/// Without a counter, and without jitter: a loss shows as what is missing, where it is, after 0.7 s.
static void test_a_loss_is_believed_after_the_decision_time(void) {
    for (const std::int64_t lost : {1, 2, 5, 40, 300, 900, 1100, 3000}) {
        const live_config config = lanes_of(1, 0);
        recorder out;
        out.width = 1;
        grid on(config, out);
        const std::string text = std::to_string(lost) + " lost";
        const std::int64_t at = 3000, next = at + lost;
        for (std::int64_t n = 0; n < next + 3000; ++n) {
            if (n >= at && n < next) continue;
            on.push(make_frame(config, 0, n, static_cast<double>(n) * 1e-3));
            TEST_ASSERT_TRUE_MESSAGE(n < next || n >= next + 690 || on.emitted() == at, text.c_str());
            TEST_ASSERT_TRUE_MESSAGE(n < next + 710 || on.emitted() > next, text.c_str());
        }
        on.finish();
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.wrong, text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(next + 3000, out.rows, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(1, out.gaps.size(), text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(at, out.gaps[0].first, text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, out.gaps[0].count, text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.gaps[0].within, text.c_str());
        // A lane that pauses for more than a second has stalled.
        TEST_ASSERT_TRUE_MESSAGE(out.gaps[0].cause == (lost >= 1000 ? gap_cause::stall : gap_cause::sequence),
                                 text.c_str());
        TEST_ASSERT_EQUAL_INT64_MESSAGE(0, on.channel(0).uncertain, text.c_str());
    }
}

/// Frames that are late and then in time again show that nothing was lost, however late they were.
static void test_what_is_made_up_for_is_no_loss(void) {
    for (const double late_s : {0.0015, 0.01, 0.3, 0.69, 1.5, 5.0})
        for (const bool at_the_end : {false, true}) {
            const live_config config = lanes_of(1, 0);
            recorder out;
            out.width = 1;
            grid on(config, out);
            const std::string text = std::to_string(late_s) + " s late, at the end " + std::to_string(at_the_end);
            const double from_s = 3, to_s = from_s + late_s;
            for (std::int64_t n = 0; n < (at_the_end ? std::llround(to_s * 1000) : 12000); ++n) {
                const double t = static_cast<double>(n) * 1e-3;
                on.push(make_frame(config, 0, n, t >= from_s && t < to_s ? to_s : t));
            }
            on.finish();
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.wrong + out.holes, text.c_str());
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, out.gaps.size(), text.c_str());
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, on.channel(0).uncertain, text.c_str());
        }
}

/// Packets of eight that end alike: where between two samples that is was never seen, a uniform law of a period.
static void test_how_well_the_place_beside_another_bus_is_known(void) {
    const auto place_std = [](std::size_t lanes, bool counted, std::size_t buses, std::int64_t packet,
                              std::int64_t count) {
        const live_config config = lanes_of(lanes, counted ? 32 : 0, 1000, buses);
        recorder out;
        out.width = lanes;
        grid on(config, out);
        for (std::int64_t n = 0; n < count; ++n) {
            const std::int64_t end = (n / packet + 1) * packet - 1;
            for (std::size_t lane = 0; lane < lanes; ++lane)
                on.push(make_frame(config, lane, n, static_cast<double>(end) * 1e-3));
        }
        on.finish();
        return on.channel(0).place_std_s;
    };
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1e-3 / std::sqrt(12.0), place_std(2, false, 2, 8, 40000));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1e-3 / std::sqrt(12.0), place_std(2, false, 2, 2, 40000));
    TEST_ASSERT_EQUAL_DOUBLE(0, place_std(2, false, 1, 8, 40000)); // there is no other bus
    TEST_ASSERT_EQUAL_DOUBLE(0, place_std(2, true, 2, 8, 40000));  // the counter tells
    TEST_ASSERT_EQUAL_DOUBLE(0, place_std(2, false, 2, 1, 40000)); // every frame by itself
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_silent_lane_is_waited_for_six_seconds);
    RUN_TEST(test_samples_wait_as_far_as_there_is_memory);
    RUN_TEST(test_a_loss_is_believed_after_the_decision_time);
    RUN_TEST(test_what_is_made_up_for_is_no_loss);
    RUN_TEST(test_how_well_the_place_beside_another_bus_is_known);
    return UNITY_END();
}
