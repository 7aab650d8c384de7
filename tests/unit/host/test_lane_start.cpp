// SPDX-License-Identifier: MIT
// What the first frames of a lane tell of its place: the line of its earliest arrivals, and how late bursts are behind
// it.
#include "align/grid.hpp"

#include <cmath>
#include <cstdint>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double period_ns = 1e6;
constexpr std::int64_t begin_ns = INT64_C(1700000000000000000);

/// Frames 0, 1, … that came at these times (periods), those behind `middle` in the second half.
lane_start start_of(const std::vector<double>& times, double middle = 1e6) {
    lane_start out;
    for (std::size_t n = 0; n < times.size(); ++n)
        out.add(static_cast<std::int64_t>(n), begin_ns + std::llround(times[n] * period_ns),
                begin_ns + std::llround(middle * period_ns), period_ns);
    return out;
}

/// When its first frame was due, periods: by the earliest arrivals alone, and in all.
double earliest(const lane_start& start) {
    return (start.earliest_ns(period_ns) - static_cast<double>(begin_ns)) / period_ns;
}
double due(const lane_start& start) { return (start.due_ns(period_ns) - static_cast<double>(begin_ns)) / period_ns; }

/// Packets of four that come with their last sample, each late by so much.
std::vector<double> packets(const std::vector<double>& late) {
    std::vector<double> out;
    for (std::size_t k = 0; k < late.size(); ++k) out.insert(out.end(), 4, static_cast<double>(4 * k + 3) + late[k]);
    return out;
}

constexpr double close_to = 1e-3; // stamps of this age have steps of 256 ns

} // namespace

static void test_punctual_frames_are_due_when_they_come(void) {
    std::vector<double> times;
    for (int n = 0; n < 30; ++n) times.push_back(n + 5);
    const lane_start start = start_of(times);
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 5, earliest(start));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 5, due(start));
    TEST_ASSERT_FALSE(start.bursty());
    TEST_ASSERT_EQUAL_INT64(30, start.frames);
    TEST_ASSERT_EQUAL_INT64(0, start.close);
}

/// Frame 3 comes in time, frame 0 with it: that was due three periods before. And who looks now and then is late by
/// more.
static void test_the_last_of_a_packet_tells_when_the_first_was_due(void) {
    const lane_start start = start_of(packets(std::vector<double>(20, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 0, earliest(start));
    TEST_ASSERT_TRUE(due(start) < -0.25 && due(start) > -0.5);
    TEST_ASSERT_TRUE(start.bursty());
    TEST_ASSERT_EQUAL_INT64(60, start.close);
    TEST_ASSERT_EQUAL_INT64(19, start.ends);
}

/// Where packets end anywhere in a tenth of a period, that tenth was seen: the looks are late in the rest of it.
static void test_looks_that_differ_are_late_by_less(void) {
    std::vector<double> late(20, 0.3), far(20, 0), held_up(20, 0.3);
    late[0] = 0.37, late[3] = 0.32, late[7] = 0.4;
    far[5] = 1;
    held_up[0] = 0.4, held_up[6] = 3.9; // once by almost four periods: the rest of none
    const double all = -due(start_of(packets(std::vector<double>(20, 0))));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 0.3, earliest(start_of(packets(late))));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 0.3 - 0.9 * all, due(start_of(packets(late))));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 0, due(start_of(packets(far))));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 0.3, due(start_of(packets(held_up))));
}

/// Where both halves have four frames and agree, the line is between them, else at the earliest of all.
static void test_two_halves(void) {
    const auto halves = [](int first, int second, double late) {
        std::vector<double> times;
        for (int n = 0; n < first + second; ++n) times.push_back(n + (n < first ? 2 : 2 + late));
        return earliest(start_of(times, first + 1.5));
    };
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2.1, halves(4, 4, 0.2));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 1.9, halves(4, 4, -0.2));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2.14, halves(9, 30, 0.28));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2, halves(4, 4, 0.32));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 1.68, halves(4, 4, -0.32));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2, halves(3, 4, 0.2));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2, halves(4, 3, 0.2));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2, halves(5, 0, 0.2));
    // The earliest of each half, its first or not, is the one that counts.
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2.1, earliest(start_of({2, 3.1, 4.1, 5.1, 6.2, 7.3, 8.3, 9.3}, 5.6)));
    TEST_ASSERT_DOUBLE_WITHIN(close_to, 2.1, earliest(start_of({2, 3.1, 4.1, 5.1, 6.3, 7.3, 8.3, 9.2}, 5.6)));
}

/// A frame a quarter of a period behind another is by itself; more than a tenth that are not make a burst.
static void test_a_tenth_of_the_frames(void) {
    const auto start = [](int close, double apart) {
        std::vector<double> times;
        for (int n = 0; n < 100; ++n) {
            const bool together = n % 2 && n / 2 < close;
            times.push_back(together ? n - 1 + apart : n);
        }
        return start_of(times);
    };
    TEST_ASSERT_EQUAL_INT64(11, start(11, 0.24).close);
    TEST_ASSERT_EQUAL_INT64(0, start(11, 0.25).close);
    TEST_ASSERT_TRUE(start(11, 0.24).bursty());
    TEST_ASSERT_FALSE(start(10, 0.24).bursty());
    lane_start beside = start(0, 0); // frames that came with those of other lanes count as well
    beside.shared = 11;
    TEST_ASSERT_TRUE(beside.bursty());
    beside.shared = 10;
    TEST_ASSERT_FALSE(beside.bursty());
    TEST_ASSERT_TRUE(due(start(11, 0.24)) < earliest(start(11, 0.24)) - 0.01);
    TEST_ASSERT_DOUBLE_WITHIN(close_to, earliest(start(10, 0.24)), due(start(10, 0.24)));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_punctual_frames_are_due_when_they_come);
    RUN_TEST(test_the_last_of_a_packet_tells_when_the_first_was_due);
    RUN_TEST(test_looks_that_differ_are_late_by_less);
    RUN_TEST(test_two_halves);
    RUN_TEST(test_a_tenth_of_the_frames);
    return UNITY_END();
}
