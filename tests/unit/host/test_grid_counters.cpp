// SPDX-License-Identifier: MIT
// What a counter says of a frame's place: beside other counters, out of order, damaged, behind a pause and at the end.
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

/// Some lanes of one rate, each with a counter of so many bits and a number.
struct stream {
    live_config config;
    row_recorder out;
    grid on;
    stream(std::size_t lanes, unsigned bits, double rate_hz = 1000)
        : config(lanes_of(lanes, bits, rate_hz)), out(lanes), on(config, out) {}

    /// The sample, whose counter is the same; its stamp is that of `at`, samples.
    void send(std::size_t lane, std::int64_t counter, std::int64_t number, double at, std::uint8_t loss = 0) {
        const std::int64_t after_ns = std::llround(at * 1e9 / config.rate_hz) + static_cast<std::int64_t>(lane) * 40000;
        drv_frame_t frame = lane_frame(config, lane, counter, number, after_ns);
        frame.loss = loss;
        on.push(frame);
    }
    void sample(std::int64_t n, std::uint8_t loss = 0) {
        for (std::size_t lane = 0; lane < out.width; ++lane) send(lane, n, n, static_cast<double>(n), loss);
    }
    void samples(std::int64_t from, std::int64_t to) {
        for (std::int64_t n = from; n < to; ++n) sample(n);
    }
    /// All rows from 0 on hold their samples; so many numbers are missing and marked.
    void check(std::int64_t rows, std::int64_t lost, const char* text) {
        on.finish();
        std::int64_t holes = 0;
        TEST_ASSERT_EQUAL_INT64_MESSAGE(rows, static_cast<std::int64_t>(out.rows.size()), text);
        for (std::size_t n = 0; n < out.rows.size(); ++n)
            for (const double number : out.rows[n]) {
                holes += number != number;
                if (number == number) TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(static_cast<double>(n), number, text);
            }
        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, holes, text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(lost, out.marked(), text);
    }
};

} // namespace

/// An eighth of the counter's range, 64 at most: so close they count the same samples, else the stamps tell.
static void test_counters_that_are_close_count_the_same_samples(void) {
    const struct {
        unsigned bits;
        std::int64_t close;
    } cases[] = {{2, 1}, {3, 1}, {4, 2}, {6, 8}, {8, 32}, {9, 64}, {10, 64}, {16, 64}, {32, 64}};
    for (const auto& each : cases)
        for (const std::int64_t apart : {-each.close - 1, -each.close, each.close, each.close + 1}) {
            if (each.bits == 2 && std::abs(apart) > 1) continue; // half of the range
            stream s(2, each.bits);
            for (std::int64_t n = 0; n < 1500; ++n) {
                s.send(0, n, n, static_cast<double>(n));
                s.send(1, n + apart, n, static_cast<double>(n));
            }
            s.on.finish();
            char text[60];
            std::snprintf(text, sizeof text, "%u bits, %lld apart", each.bits, static_cast<long long>(apart));
            TEST_ASSERT_TRUE_MESSAGE(s.out.rows.size() > 1400, text);
            const double off = std::abs(apart) <= each.close ? static_cast<double>(apart) : 0;
            for (std::size_t n = 0; n < 1400; ++n)
                TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(off, s.out.rows[n][0] - s.out.rows[n][1], text);
        }
}

/// A frame that is late stands in its row as long as that waits for it; one that came twice is no other sample.
static void test_late_frames_and_doubled_ones(void) {
    for (const std::int64_t late : {1, 2, 8, 9, 15, 16, 17, 40}) {
        stream s(2, 16);
        const std::string text = "late by " + std::to_string(late);
        for (std::int64_t n = 0; n < 400; ++n) {
            s.send(0, n, n, static_cast<double>(n));
            if (n != 100 && n != 200) s.send(1, n, n, static_cast<double>(n));
            if (n == 100 + late) s.send(1, 100, 100, static_cast<double>(n));
            if (n == 250) s.send(1, 250, 250, 250.1);
            if (n == 300 + late) s.send(1, 300, 300, static_cast<double>(n));
        }
        // Nine frames behind it the row of 100 goes out, and more than 16 behind it the frame is taken for damaged.
        s.on.finish();
        const bool waits = late < 9, far = late > 16;
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(400, s.out.rows.size(), text.c_str());
        TEST_ASSERT_EQUAL_INT_MESSAGE(waits ? 1 : 2, s.out.gaps.size(), text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(far ? 0 : 1, s.on.bus(0).out_of_order, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(far || waits ? 0 : 1, s.on.bus(0).too_late, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(far ? 1 : 0, s.on.bus(0).decode_errors, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(2, s.on.bus(0).duplicate, text.c_str()); // 250 and 300
        for (std::size_t n = 0; n < 400; ++n)
            if (s.out.rows[n][1] == s.out.rows[n][1])
                TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(static_cast<double>(n), s.out.rows[n][1], text.c_str());
    }
}

/// A frame that overtook others is recalled when they come near; what nine others have not come near was damaged.
static void test_a_frame_far_ahead_of_its_place(void) {
    for (std::int64_t ahead = 2; ahead < 30; ++ahead) {
        stream s(1, 16);
        const std::string text = "ahead by " + std::to_string(ahead);
        s.samples(0, 100);
        s.send(0, 99 + ahead, 99 + ahead, 100.5);
        for (std::int64_t n = 100; n < 300; ++n)
            if (n != 99 + ahead) s.sample(n);
        const bool damaged = ahead > 16 + 8;
        s.check(300, damaged ? 1 : 0, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(damaged ? 1 : 0, s.on.bus(0).decode_errors, text.c_str());
    }
}

/// Samples that are missing are missing, however many; a second frame says so where they are more than sixteen.
static void test_losses_of_every_length(void) {
    for (const std::int64_t lost : {1, 2, 15, 16, 17, 18, 63, 249, 250, 251, 1000, 4999})
        for (const bool said : {false, true}) {
            stream s(1, 16);
            const std::string text = std::to_string(lost) + " lost, said " + std::to_string(said);
            s.samples(0, 100);
            s.sample(100 + lost, said ? DRV_LOSS_DRIVER : 0);
            s.samples(101 + lost, 300 + lost);
            s.check(300 + lost, lost, text.c_str());
            TEST_ASSERT_EQUAL_INT_MESSAGE(1, s.out.gaps.size(), text.c_str());
            TEST_ASSERT_EQUAL_INT64_MESSAGE(100, s.out.gaps[0].first, text.c_str());
            TEST_ASSERT_TRUE_MESSAGE(s.out.gaps[0].cause == (said ? gap_cause::driver : gap_cause::sequence),
                                     text.c_str());
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, s.on.bus(0).decode_errors, text.c_str());
        }
}

/// Of several causes the one that takes the most with it is named.
static void test_the_cause_of_several(void) {
    const struct {
        unsigned loss;
        gap_cause cause;
    } cases[] = {{DRV_LOSS_CRC, gap_cause::crc},
                 {DRV_LOSS_DRIVER, gap_cause::driver},
                 {DRV_LOSS_OVERFLOW, gap_cause::socket_overflow},
                 {DRV_LOSS_LINK, gap_cause::link_down},
                 {DRV_LOSS_CRC | DRV_LOSS_DRIVER, gap_cause::driver},
                 {DRV_LOSS_CRC | DRV_LOSS_DRIVER | DRV_LOSS_OVERFLOW, gap_cause::socket_overflow},
                 {DRV_LOSS_CRC | DRV_LOSS_DRIVER | DRV_LOSS_OVERFLOW | DRV_LOSS_LINK, gap_cause::link_down}};
    for (const auto& each : cases) {
        stream s(1, 16);
        s.samples(0, 100);
        s.sample(103, static_cast<std::uint8_t>(each.loss));
        s.samples(104, 150);
        s.sample(152); // what was said holds once
        s.samples(153, 200);
        s.check(200, 5, "causes");
        TEST_ASSERT_EQUAL_UINT64(2, s.out.gaps.size());
        TEST_ASSERT_TRUE(s.out.gaps[0].cause == each.cause);
        TEST_ASSERT_TRUE(s.out.gaps[1].cause == gap_cause::sequence);
        TEST_ASSERT_EQUAL_UINT64(3, s.on.bus(0).lost[static_cast<std::size_t>(each.cause)]);
    }
}

/// A counter of eight bits that went round many times: behind a known loss, or a silence of more than five seconds, the
/// clock tells how often, though the frame may be late or early by less than half a round.
static void test_rounds_of_the_counter_by_the_clock(void) {
    for (const std::int64_t pause : {255, 300, 500, 1000, 4000, 5200, 5365, 5375, 9000, 60000})
        for (const double off : {-100.0, 0.0, 100.0})
            for (const bool said : {false, true}) {
                if (!said && static_cast<double>(pause) + off < 5000) continue;
                stream s(1, 8);
                const std::string text = std::to_string(pause) + " missing, said " + std::to_string(said);
                s.samples(0, 100);
                const std::int64_t next = 100 + pause;
                s.send(0, next, next, static_cast<double>(next) + off, said ? DRV_LOSS_LINK : 0);
                for (std::int64_t n = next + 1; n < next + 100; ++n)
                    s.send(0, n, n, static_cast<double>(n) + std::max(0.0, off));
                s.check(next + 100, pause, text.c_str());
            }
}

/// Counters of three and four bits, whatever they stand at behind a silence: no frame behind it is late or a double.
static void test_any_round_of_a_short_counter(void) {
    for (const unsigned bits : {3U, 4U, 5U})
        for (std::int64_t pause = 6000; pause < 6032; ++pause) {
            if (pause % (std::int64_t{1} << bits) == 0) continue; // it counts on by one: the clock may have been set
            stream s(1, bits);
            s.samples(0, 100);
            s.samples(100 + pause, 200 + pause);
            s.check(200 + pause, pause, std::to_string(pause).c_str());
            TEST_ASSERT_EQUAL_UINT64(0, s.on.bus(0).duplicate + s.on.bus(0).out_of_order);
        }
}

/// Nothing confirms the last frame: ahead within a quarter of a second it is believed, else it is damage.
static void test_a_last_frame_that_is_off(void) {
    for (const std::int64_t ahead : {17, 100, 250, 251, 30000, -17, -90}) {
        stream s(1, 16);
        const std::string text = "last one ahead by " + std::to_string(ahead);
        s.samples(0, 100);
        s.send(0, 99 + ahead, ahead > 0 ? 99 + ahead : 7777, 100); // back: not the number that came in its place
        const bool believed = ahead > 0 && ahead <= 250;
        s.check(believed ? 100 + ahead : 100, believed ? ahead - 1 : 0, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(believed ? 0 : 1, s.on.bus(0).decode_errors, text.c_str());
    }
}

/// Losses with a sample between them: each has the cause that was reported with it.
static void test_causes_of_losses_close_together(void) {
    const unsigned said[] = {DRV_LOSS_OVERFLOW, 0, DRV_LOSS_DRIVER, DRV_LOSS_LINK, 0, 0, DRV_LOSS_CRC};
    const gap_cause causes[] = {
        gap_cause::socket_overflow, gap_cause::sequence, gap_cause::driver, gap_cause::link_down,
        gap_cause::sequence,        gap_cause::sequence, gap_cause::crc};
    stream s(1, 16);
    s.samples(0, 100);
    for (std::int64_t k = 0; k < 70; ++k) s.sample(101 + 2 * k, static_cast<std::uint8_t>(said[k % 7]));
    s.check(240, 70, "close together");
    TEST_ASSERT_EQUAL_UINT64(70, s.out.gaps.size());
    for (std::size_t k = 0; k < 70; ++k) TEST_ASSERT_TRUE(s.out.gaps[k].cause == causes[k % 7]);
}

/// What was said of a loss is remembered while its sample waits for another lane.
static void test_a_cause_is_remembered_while_the_sample_waits(void) {
    stream s(2, 16);
    s.samples(0, 100);
    s.send(0, 103, 103, 103, DRV_LOSS_OVERFLOW);
    for (std::int64_t n = 104; n < 600; ++n) s.send(0, n, n, static_cast<double>(n));
    for (std::int64_t n = 100; n < 600; ++n) s.send(1, n, n, 600);
    s.check(600, 3, "waits");
    TEST_ASSERT_EQUAL_UINT64(1, s.out.gaps.size());
    TEST_ASSERT_TRUE(s.out.gaps[0].cause == gap_cause::socket_overflow);
}

/// Behind a long silence the clock may be off by a fifth of it: it tells the rounds of the counter, not the samples.
static void test_a_long_silence_by_a_clock_that_is_off(void) {
    for (const std::int64_t off : {-9000, 9000}) {
        stream s(1, 16);
        s.samples(0, 100);
        for (std::int64_t n = 60100; n < 60200; ++n) s.send(0, n, n, static_cast<double>(n + off));
        s.check(60200, 60000, off > 0 ? "late" : "early");
    }
}

/// Two frames ahead of all by a quarter of a second at most are what is left of a bad bus; one beyond it needs another.
static void test_two_frames_far_ahead(void) {
    for (const std::int64_t ahead : {40, 249, 250, 251, 252}) {
        stream s(1, 16);
        const std::string text = "ahead by " + std::to_string(ahead);
        s.samples(0, 100);
        s.sample(79 + ahead);
        s.samples(99 + ahead, 200 + ahead);
        const bool damaged = ahead > 250;
        s.check(200 + ahead, damaged ? ahead - 1 : ahead - 2, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(damaged ? 1 : 0, s.on.bus(0).decode_errors, text.c_str());
    }
}

/// A double of an old frame behind a silence that is longer than six seconds is a double, and the silence a gap.
static void test_an_old_frame_behind_a_silence(void) {
    for (const std::int64_t old : {99, 98, 90}) {
        stream s(1, 16, 10);
        const std::string text = "frame " + std::to_string(old);
        s.samples(0, 100);
        s.send(0, old, old, 161.5);
        s.samples(162, 300);
        s.check(300, 62, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(1, s.on.bus(0).duplicate, text.c_str());
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, s.on.bus(0).decode_errors, text.c_str());
    }
}

/// A sender that counts from elsewhere on: two frames that agree say so, and the clock says how long it was away.
static void test_a_sender_that_starts_again(void) {
    for (const std::int64_t away : {1, 2, 3, 50, 1000})
        for (const std::int64_t counter : {0, 20000, 65000}) {
            stream s(1, 16);
            const std::string text = std::to_string(away) + " away, counts from " + std::to_string(counter);
            for (std::int64_t n = 0; n < 100; ++n) s.send(0, 30000 + n, n, static_cast<double>(n));
            const std::int64_t next = 100 + away;
            for (std::int64_t n = 0; n < 100; ++n)
                s.send(0, counter + n, next + n, static_cast<double>(next + n) + 0.01);
            s.check(next + 100, away, text.c_str());
            TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, s.on.bus(0).decode_errors, text.c_str());
        }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_counters_that_are_close_count_the_same_samples);
    RUN_TEST(test_late_frames_and_doubled_ones);
    RUN_TEST(test_a_frame_far_ahead_of_its_place);
    RUN_TEST(test_losses_of_every_length);
    RUN_TEST(test_the_cause_of_several);
    RUN_TEST(test_rounds_of_the_counter_by_the_clock);
    RUN_TEST(test_any_round_of_a_short_counter);
    RUN_TEST(test_causes_of_losses_close_together);
    RUN_TEST(test_two_frames_far_ahead);
    RUN_TEST(test_an_old_frame_behind_a_silence);
    RUN_TEST(test_a_cause_is_remembered_while_the_sample_waits);
    RUN_TEST(test_a_long_silence_by_a_clock_that_is_off);
    RUN_TEST(test_a_last_frame_that_is_off);
    RUN_TEST(test_a_sender_that_starts_again);
    return UNITY_END();
}
