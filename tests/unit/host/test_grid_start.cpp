// SPDX-License-Identifier: MIT
// Where the grid begins: lanes of several counters, buses and none, each heard from another sample on. Sample 0 is the
// first one that every lane can have, and every number stands in its row from there on, whichever lane is heard first.
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

/// One message of one channel. Its number is the sample's.
struct sender {
    std::size_t bus = 0;
    std::optional<std::int64_t> counter; ///< of sample 0, 16 bits
    std::int64_t first = 0;              ///< the sample from which on it is heard
    double late_s = 0;                   ///< on its way, always
};

live_config make_config(const std::vector<sender>& senders, double rate_hz) {
    live_config config = lanes_of(senders.size(), 16, rate_hz, 4);
    for (std::size_t i = 0; i < senders.size(); ++i) {
        config.channels[i].bus = senders[i].bus;
        if (!senders[i].counter) config.channels[i].sequence.reset();
    }
    return config;
}

drv_frame_t make_frame(const live_config& config, const sender& from, std::size_t which, std::int64_t sample) {
    const double sent_s = static_cast<double>(sample) / config.rate_hz;
    return lane_frame(config, which, from.counter.value_or(0) + sample, sample,
                      std::llround(1e9 * (sent_s + from.late_s)) + static_cast<std::int64_t>(which) * 40000);
}

struct recorder : grid_sink {
    std::size_t width = 0;
    std::int64_t base = -1, rows = 0, wrong = 0, holes = 0, marked = 0;
    void on_sample(std::int64_t index, const double* row) override {
        wrong += index != rows++;
        for (std::size_t i = 0; i < width; ++i) {
            if (row[i] != row[i]) {
                ++holes;
                continue;
            }
            if (base < 0) base = static_cast<std::int64_t>(row[i]) - index;
            wrong += static_cast<std::int64_t>(row[i]) != base + index;
        }
    }
    void on_missing(std::int64_t, std::int64_t count) override {
        rows += count;
        holes += count * static_cast<std::int64_t>(width);
    }
    void on_gap(const grid_gap& gap) override { marked += gap.count; }
};

/// Samples before `end` from all of them, in the order of their arrival.
void play(const std::vector<sender>& senders, std::int64_t end, recorder& out, double rate_hz = 1000) {
    const live_config config = make_config(senders, rate_hz);
    out.width = senders.size();
    grid on(config, out);
    std::vector<drv_frame_t> frames;
    for (std::int64_t n = 0; n < end; ++n)
        for (std::size_t i = 0; i < senders.size(); ++i)
            if (n >= senders[i].first) frames.push_back(make_frame(config, senders[i], i, n));
    std::stable_sort(frames.begin(), frames.end(),
                     [](const drv_frame_t& a, const drv_frame_t& b) { return a.time_ns < b.time_ns; });
    for (const drv_frame_t& frame : frames) on.push(frame);
    on.finish();
}

/// Each of them from its own sample on, the one that is heard first at any place.
void check_starts(std::vector<sender> senders, const char* what) {
    static const std::int64_t firsts[] = {0, 3, 10, 6, 17, 1};
    for (std::size_t turn = 0; turn < senders.size(); ++turn) {
        std::int64_t begin = 0;
        for (std::size_t i = 0; i < senders.size(); ++i) {
            senders[i].first = firsts[(i + turn) % senders.size()];
            begin = std::max(begin, senders[i].first);
        }
        for (const std::int64_t end : {60, 3000}) { // cut before enough is known for the begin, and long
            recorder out;
            play(senders, end, out);
            char text[80];
            std::snprintf(text, sizeof text, "%s, turn %zu, %lld samples", what, turn, static_cast<long long>(end));
            TEST_ASSERT_EQUAL_INT64_MESSAGE(begin, out.base, text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.wrong + out.holes + out.marked, text);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(end - begin, out.rows, text);
        }
    }
}

} // namespace

static void test_counters_that_have_nothing_in_common(void) {
    check_starts({{0, 100}, {0, 20000}, {0, 40000}, {0, 65000}}, "one bus");
    check_starts({{0, 100}, {1, 20000}, {2, 40000}, {3, 65000}}, "four buses");
}

static void test_families_of_counters(void) {
    check_starts({{0, 100}, {1, 40000}, {0, 100}, {1, 40000}}, "two families");
    check_starts({{0, 65530}, {1, 20000}, {2, 40000}, {2, 40000}, {1, 20000}, {0, 65530}}, "three families");
}

static void test_lanes_without_a_counter(void) {
    check_starts({{0, {}}, {0, {}}, {0, {}}}, "one bus");
    check_starts({{0, {}}, {1, {}}, {2, {}}}, "three buses");
    check_starts({{0, {}}, {1, {}}, {0, {}}, {1, {}}}, "two of each bus");
}

static void test_lanes_with_a_counter_beside_those_without(void) {
    check_starts({{0, {}}, {1, 100}, {0, 30000}, {2, {}}, {1, 100}}, "mixed");
    check_starts({{0, 100}, {0, {}}, {1, 50000}, {1, {}}}, "mixed by bus");
}

/// One of four is never heard: the others stand where they belong, and its samples are missing.
static void test_a_lane_that_never_comes(void) {
    for (const bool counted : {false, true})
        for (std::size_t silent = 0; silent < 4; ++silent)
            for (const std::int64_t end : {100, 9000}) {
                std::vector<sender> senders(4);
                for (std::size_t i = 0; i < 4; ++i) {
                    senders[i].bus = i;
                    if (counted) senders[i].counter = static_cast<std::int64_t>(100 + 15000 * i);
                    senders[i].first = static_cast<std::int64_t>(5 * i);
                }
                senders[silent].first = end;
                const std::int64_t begin = silent == 3 ? 10 : 15;
                recorder out;
                play(senders, end, out);
                char text[80];
                std::snprintf(text, sizeof text, "%zu is silent, counted: %d, %lld samples", silent, counted,
                              static_cast<long long>(end));
                TEST_ASSERT_EQUAL_INT64_MESSAGE(begin, out.base, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.wrong, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(out.rows, out.holes, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(out.rows, out.marked, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(end - begin - 1, out.rows, text); // the last sample was cut by the end
            }
}

/// One that is first heard when the grid has long begun, before or after the others ceased to wait: by its counter
/// where that is one of theirs, else by the line of its first frames.
static void test_a_lane_that_comes_late(void) {
    for (const int kind : {0, 1, 2}) // no counters, counters that have nothing in common, one counter
        for (std::size_t which = 0; which < 3; ++which)
            for (const std::int64_t first : {2500, 9000}) {
                std::vector<sender> senders(3);
                for (std::size_t i = 0; i < 3; ++i) {
                    senders[i].bus = i % 2;
                    if (kind > 0) senders[i].counter = static_cast<std::int64_t>(kind == 1 ? 100 + 15000 * i : 5000);
                }
                senders[which].first = first;
                recorder out;
                play(senders, 12000, out);
                char text[80];
                std::snprintf(text, sizeof text, "%zu comes at %lld, kind %d", which, static_cast<long long>(first),
                              kind);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.base, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(0, out.wrong, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(first, out.holes, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(first, out.marked, text);
                TEST_ASSERT_EQUAL_INT64_MESSAGE(12000, out.rows, text);
            }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_counters_that_have_nothing_in_common);
    RUN_TEST(test_families_of_counters);
    RUN_TEST(test_lanes_without_a_counter);
    RUN_TEST(test_lanes_with_a_counter_beside_those_without);
    RUN_TEST(test_a_lane_that_never_comes);
    RUN_TEST(test_a_lane_that_comes_late);
    return UNITY_END();
}
