// SPDX-License-Identifier: MIT
// Every fault over many seeds, from a source through the ring to the grid: nothing crashes or hangs, every number stands in
// its row, and the marked gaps are the losses that were made.
#include "fault_source.h"
#include "grid_frames.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <drv/ring.h>
#include <memory>
#include <numeric>
#include <seeds.h>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr std::int64_t period_ns = 1000000;

/// Counts what comes out; `strange` is every row or number that is not where it should be.
struct recorder : grid_sink {
    std::int64_t at = 0, holes = 0, strange = 0, marked = 0;
    std::array<std::int64_t, 6> by{};
    std::size_t width = 0;
    void on_sample(std::int64_t index, const double* row) override {
        strange += index != at++;
        for (std::size_t i = 0; i < width; ++i) {
            if (row[i] != row[i])
                ++holes;
            else
                strange += static_cast<std::int64_t>(row[i]) != index;
        }
    }
    void on_missing(std::int64_t index, std::int64_t count) override {
        strange += index != at;
        at += count;
        holes += count * static_cast<std::int64_t>(width);
    }
    void on_gap(const grid_gap& gap) override {
        strange += gap.last - gap.first + 1 != gap.count;
        marked += gap.count;
        by[static_cast<std::size_t>(gap.cause)] += gap.count;
    }
};

struct outcome {
    recorder out;
    fault_source_t source{};
    std::uint64_t ring_lost = 0, duplicate = 0, decode_errors = 0, received = 0;
    std::int64_t missing = 0;
    bool ended = false;
    std::uint64_t lost() const { return std::accumulate(source.lost, source.lost + FAULT_KINDS, ring_lost); }
};

/// One stream. @param stall_per_mille  how often the reader of a small ring falls asleep
void play(const fault_plan_t& plan, unsigned stall_per_mille, outcome& result, bool counted = true) {
    const live_config config = lanes_of(static_cast<std::size_t>(plan.lanes), counted ? 16 : 0);
    grid on(config, result.out);
    result.out.width = config.channels.size();
    fault_source_make(&result.source, &plan);
    drv_source_t& source = result.source.source;
    source.state = &result.source; // it stands in its own frame now
    constexpr std::size_t capacity = 128;
    std::vector<std::byte> block(drv_ring_memsize(capacity));
    drv_ring_t* ring = drv_ring_create(capacity, block.data(), block.size());
    drv_frame_t batch[64];
    std::uint32_t dice = plan.seed * 2654435761u + 1;
    int asleep = 0;
    const std::int64_t most_reads = 40 * plan.samples * plan.lanes + 1000;
    for (std::int64_t reads = 0; reads < most_reads && !result.ended; ++reads) { // bounded: a hang fails the test
        const int got = source.ops->read(&source, batch, 64);
        result.ended = got == DRV_END;
        if (got > 0) drv_ring_push(ring, batch, static_cast<std::size_t>(got));
        dice = dice * 1664525u + 1013904223u;
        const bool inner = result.source.sample > 40 && result.source.sample < plan.samples - 150;
        if (asleep == 0 && inner && (dice >> 8) % 1000 < stall_per_mille)
            asleep = 1 + static_cast<int>((dice >> 20) % 6);
        if (asleep > 0 && inner && --asleep > 0) continue;
        for (std::size_t count; (count = drv_ring_pop(ring, batch, 64)) > 0;)
            for (std::size_t i = 0; i < count; ++i) on.push(batch[i]);
    }
    on.finish();
    result.ring_lost = drv_ring_overrun(ring);
    result.duplicate = on.bus(0).duplicate;
    result.decode_errors = on.bus(0).decode_errors;
    result.received = on.bus(0).received;
    for (std::size_t c = 0; c < config.channels.size(); ++c)
        result.missing += on.channel(c).expected - on.channel(c).received;
}

fault_plan_t plan_of(std::uint32_t seed) {
    fault_plan_t plan{};
    plan.seed = seed;
    plan.samples = 400 + seed % 500;
    plan.lanes = 1 + static_cast<std::int32_t>(seed % FAULT_LANES);
    plan.first_counter = seed * 7919u;
    plan.period_ns = period_ns;
    return plan;
}

unsigned seeds() {
    if (std::getenv("OKID_FAULT_SEEDS")) return static_cast<unsigned>(std::atoi(std::getenv("OKID_FAULT_SEEDS")));
    return draw_seeds(250, 10000);
}

std::string title(const char* what, const fault_plan_t& plan, const outcome& o) {
    char text[300];
    std::snprintf(text, sizeof text, "%s, seed %u: %d lanes, %lld samples: %llu lost, %lld marked, %lld rows", what,
                  plan.seed, plan.lanes, static_cast<long long>(plan.samples),
                  static_cast<unsigned long long>(o.lost()), static_cast<long long>(o.out.marked),
                  static_cast<long long>(o.out.at));
    return text;
}

/// What holds for every stream, whatever befell it.
void check_consistent(const outcome& o, const std::string& text) {
    TEST_ASSERT_TRUE_MESSAGE(o.ended, text.c_str());
    TEST_ASSERT_EQUAL_INT64_MESSAGE(o.out.holes, o.out.marked, text.c_str());
    TEST_ASSERT_EQUAL_INT64_MESSAGE(o.missing, o.out.marked, text.c_str());
}

/// The gaps are the losses, none more and none less, and all numbers are in their rows.
void check_exact(const outcome& o, const fault_plan_t& plan, const std::string& text) {
    check_consistent(o, text);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(0, o.out.strange, text.c_str());
    TEST_ASSERT_EQUAL_INT64_MESSAGE(plan.samples, o.out.at, text.c_str());
    TEST_ASSERT_EQUAL_INT64_MESSAGE(static_cast<std::int64_t>(o.lost()), o.out.marked, text.c_str());
    if (o.ring_lost == 0) {
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(o.source.done[FAULT_DUPLICATE], o.duplicate, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(o.source.done[FAULT_TRUNCATE], o.decode_errors, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(o.source.good + o.source.done[FAULT_DUPLICATE] + o.source.done[FAULT_TRUNCATE],
                                         o.received, text.c_str());
    }
}

/// Alone, with the cause its losses must be booked under.
void check_kind(fault_kind_t kind, unsigned per_mille, gap_cause cause, bool raw_stamps = false) {
    std::uint64_t made = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        fault_plan_t plan = plan_of(seed);
        plan.per_mille[kind] = per_mille;
        plan.raw_stamps = raw_stamps;
        const auto o = std::make_unique<outcome>();
        play(plan, 0, *o);
        const std::string text = title(fault_name(kind), plan, *o);
        check_exact(*o, plan, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(o->out.marked, o->out.by[static_cast<std::size_t>(cause)], text.c_str());
        made += o->source.done[kind];
    }
    TEST_ASSERT_TRUE_MESSAGE(made >= seeds(), fault_name(kind)); // the test tests something
}

} // namespace

static void test_drop() { check_kind(FAULT_DROP, 30, gap_cause::sequence); }
static void test_overflow() { check_kind(FAULT_OVERFLOW, 5, gap_cause::socket_overflow); }
static void test_duplicate() { check_kind(FAULT_DUPLICATE, 50, gap_cause::sequence); }
static void test_reorder() { check_kind(FAULT_REORDER, 100, gap_cause::sequence); }
static void test_flip_data() { check_kind(FAULT_FLIP_DATA, 100, gap_cause::sequence); }
static void test_truncate() { check_kind(FAULT_TRUNCATE, 30, gap_cause::sequence); }
static void test_oversize() { check_kind(FAULT_OVERSIZE, 100, gap_cause::sequence); }
static void test_foreign() { check_kind(FAULT_FOREIGN, 30, gap_cause::sequence); }
static void test_error_frames() { check_kind(FAULT_ERROR_FRAME, 100, gap_cause::sequence); }
static void test_link_down() { check_kind(FAULT_DOWN, 5, gap_cause::link_down); }
static void test_device_gone() { check_kind(FAULT_GONE, 5, gap_cause::link_down); }
static void test_interrupted() { check_kind(FAULT_INTERRUPT, 200, gap_cause::sequence); }
static void test_nothing_yet() { check_kind(FAULT_AGAIN, 200, gap_cause::sequence); }
static void test_failing_reads() { check_kind(FAULT_FAIL, 200, gap_cause::sequence); }
static void test_short_reads() { check_kind(FAULT_SHORT, 500, gap_cause::sequence); }
static void test_clock_set_by_an_hour() { check_kind(FAULT_CLOCK, 10, gap_cause::sequence); }
static void test_clock_set_by_an_hour_in_a_log() { check_kind(FAULT_CLOCK, 10, gap_cause::sequence, true); }
static void test_stamp_wrap() { check_kind(FAULT_STAMP_WRAP, 10, gap_cause::sequence); }

/// Losses of every kind and a clock that is set by an hour, also in the same moment.
static void check_mixture(bool counted, unsigned clock_per_mille) {
    std::uint64_t made = 0, set = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        fault_plan_t plan = plan_of(seed);
        for (const fault_kind_t kind : {FAULT_DROP, FAULT_TRUNCATE, FAULT_FOREIGN, FAULT_DUPLICATE, FAULT_REORDER})
            plan.per_mille[kind] = seed * 31 % 40;
        if (!counted) // the order of arrival is that of the samples, and each frame is one
            plan.per_mille[FAULT_DUPLICATE] = plan.per_mille[FAULT_REORDER] = 0;
        for (const fault_kind_t kind : {FAULT_OVERFLOW, FAULT_DOWN, FAULT_GONE}) plan.per_mille[kind] = 3;
        plan.per_mille[FAULT_CLOCK] = clock_per_mille;
        const auto o = std::make_unique<outcome>();
        play(plan, 0, *o, counted);
        check_exact(*o, plan, title(counted ? "mixture" : "mixture without a counter", plan, *o));
        made += o->lost();
        set += o->source.done[FAULT_CLOCK];
    }
    TEST_ASSERT_TRUE(made >= seeds() && (clock_per_mille == 0 || set >= seeds()));
}

static void test_clock_set_among_losses() { check_mixture(true, 30); }
static void test_losses_without_a_counter() { check_mixture(false, 0); }
static void test_clock_set_among_losses_without_a_counter() { check_mixture(false, 30); }

/// The only frame between two outages, each shorter than the grid's window and both together longer, comes some places
/// late: its sample waits for it.
static void test_a_late_frame_between_two_outages() {
    const live_config config = lanes_of(1, 16);
    recorder out;
    out.width = 1;
    grid on(config, out);
    const auto send = [&](std::uint16_t sample, std::uint8_t loss) {
        drv_frame_t frame{};
        frame.id = 0x100;
        frame.len = 8;
        frame.loss = loss;
        frame.time_ns = day_ns + sample * period_ns;
        frame.data[0] = frame.data[4] = static_cast<std::uint8_t>(sample);
        frame.data[1] = frame.data[5] = static_cast<std::uint8_t>(sample >> 8);
        on.push(frame);
    };
    for (std::uint16_t n = 0; n < 30; ++n) send(n, 0);
    send(396, DRV_LOSS_LINK);
    for (std::uint16_t n = 397; n < 403; ++n) send(n, 0);
    send(203, 0);
    for (std::uint16_t n = 403; n < 500; ++n) send(n, 0);
    on.finish();
    TEST_ASSERT_EQUAL_INT64(0, out.strange);
    TEST_ASSERT_EQUAL_INT64(500, out.at);
    TEST_ASSERT_EQUAL_INT64(365, out.marked); // 30..202 and 204..395
}

static void test_reader_asleep() {
    std::uint64_t made = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        fault_plan_t plan = plan_of(seed);
        plan.lanes = FAULT_LANES;
        const auto o = std::make_unique<outcome>();
        play(plan, 100, *o);
        const std::string text = title("ring overrun", plan, *o);
        check_exact(*o, plan, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(o->out.marked, o->out.by[static_cast<std::size_t>(gap_cause::driver)],
                                        text.c_str());
        made += o->ring_lost;
    }
    TEST_ASSERT_TRUE(made >= seeds());
}

/// A damaged counter puts a frame where it does not belong: the grid cannot know which, but it stays whole.
static void test_flipped_counters() {
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        fault_plan_t plan = plan_of(seed);
        plan.per_mille[FAULT_FLIP_COUNTER] = 20;
        const auto o = std::make_unique<outcome>();
        play(plan, 0, *o);
        const std::string text = title("flipped counter", plan, *o) + " strange " + std::to_string(o->out.strange);
        check_consistent(*o, text);
        const auto flips = static_cast<std::int64_t>(o->source.done[FAULT_FLIP_COUNTER]);
        const std::int64_t beyond = o->out.at - plan.samples; // rows that only a damaged counter told of
        TEST_ASSERT_TRUE_MESSAGE(beyond >= 0 && beyond <= 256, text.c_str());
        TEST_ASSERT_TRUE_MESSAGE(o->out.marked <= flips + beyond * plan.lanes, text.c_str());
        TEST_ASSERT_TRUE_MESSAGE(o->out.strange <= flips, text.c_str());
    }
}

/// Everything at once, but what cannot be told apart.
static void test_all_together() {
    std::uint64_t made = 0;
    for (unsigned seed = 1; seed <= seeds(); ++seed) {
        fault_plan_t plan = plan_of(seed);
        for (const fault_kind_t kind : {FAULT_DROP, FAULT_TRUNCATE, FAULT_FOREIGN, FAULT_DUPLICATE, FAULT_REORDER,
                                        FAULT_FLIP_DATA, FAULT_OVERSIZE, FAULT_ERROR_FRAME})
            plan.per_mille[kind] = seed * 31 % 40;
        for (const fault_kind_t kind : {FAULT_OVERFLOW, FAULT_DOWN, FAULT_GONE, FAULT_STAMP_WRAP, FAULT_CLOCK})
            plan.per_mille[kind] = 2;
        for (const fault_kind_t kind : {FAULT_INTERRUPT, FAULT_AGAIN, FAULT_FAIL, FAULT_SHORT})
            plan.per_mille[kind] = 100;
        const auto o = std::make_unique<outcome>();
        play(plan, 0, *o);
        check_exact(*o, plan, title("all together", plan, *o));
        made += o->lost();
    }
    TEST_ASSERT_TRUE(made >= seeds());
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_drop);
    RUN_TEST(test_overflow);
    RUN_TEST(test_duplicate);
    RUN_TEST(test_reorder);
    RUN_TEST(test_flip_data);
    RUN_TEST(test_truncate);
    RUN_TEST(test_oversize);
    RUN_TEST(test_foreign);
    RUN_TEST(test_error_frames);
    RUN_TEST(test_link_down);
    RUN_TEST(test_device_gone);
    RUN_TEST(test_interrupted);
    RUN_TEST(test_nothing_yet);
    RUN_TEST(test_failing_reads);
    RUN_TEST(test_short_reads);
    RUN_TEST(test_clock_set_by_an_hour);
    RUN_TEST(test_clock_set_by_an_hour_in_a_log);
    RUN_TEST(test_clock_set_among_losses);
    RUN_TEST(test_losses_without_a_counter);
    RUN_TEST(test_clock_set_among_losses_without_a_counter);
    RUN_TEST(test_a_late_frame_between_two_outages);
    RUN_TEST(test_stamp_wrap);
    RUN_TEST(test_reader_asleep);
    RUN_TEST(test_flipped_counters);
    RUN_TEST(test_all_together);
    return UNITY_END();
}
