// SPDX-License-Identifier: MIT
// Multiplexed messages whose counter counts samples, or frames: every number in its row, every loss where it was made.
#include "grid_frames.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <seeds.h>
#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double rate_hz = 500;

/// Pages first, first + 1 … of message 0x100 in byte 0, a counter of so many bits, a number from byte 4 on; `plain`: a number
/// that is in every page.
live_config make_config(std::uint64_t first, std::size_t pages, unsigned bits, bool plain) {
    live_config config;
    config.rate_hz = rate_hz;
    config.buses.resize(1);
    for (std::size_t i = 0; i < pages + plain; ++i) {
        channel_config channel = channel_at(0x100, bits_at(i < pages ? 32 : 64, 32), bits_at(8, bits));
        channel.name = "c" + std::to_string(i);
        if (i < pages) channel.selectors.push_back({bits_at(0, 8), {{first + i, first + i}}});
        config.channels.push_back(channel);
    }
    return config;
}

struct rows : grid_sink {
    std::int64_t wrong = 0, base = -1, bulk = 0;
    std::vector<std::vector<double>> all;
    std::size_t width = 0;
    void on_sample(std::int64_t index, const double* row) override {
        all.emplace_back(row, row + width);
        for (std::size_t i = 0; i < width; ++i) {
            if (row[i] != row[i]) continue;
            if (base < 0) base = static_cast<std::int64_t>(row[i]) - index;
            wrong += static_cast<std::int64_t>(row[i]) != base + index;
        }
    }
    void on_missing(std::int64_t, std::int64_t count) override { wrong += count, bulk += count; }
    void on_gap(const grid_gap& gap) override { marked += gap.count; }
    std::int64_t marked = 0;
};

struct node {
    std::size_t sent = 4, first = 0, asked = 4; ///< pages it sends, and those of them that are channels
    unsigned bits = 16;
    bool counts_frames = true, plain = false, back_to_back = true;
    std::int64_t counter = 0;
    std::size_t joined = 0; ///< the page that is heard first

    drv_frame_t frame(std::int64_t sample, std::size_t page) const {
        drv_frame_t out{};
        out.id = 0x100;
        out.flags = DRV_FRAME_FD | DRV_FRAME_BRS;
        out.len = 64;
        const double apart_s = back_to_back ? 120e-6 : 1 / rate_hz / static_cast<double>(sent);
        out.time_ns =
            day_ns + std::llround(1e9 * (static_cast<double>(sample) / rate_hz + static_cast<double>(page) * apart_s));
        const auto frames = static_cast<std::int64_t>(sent) * sample + static_cast<std::int64_t>(page);
        const drv_signal_t its = bits_at(8, bits), number = bits_at(32, 32), more = bits_at(64, 32);
        out.data[0] = static_cast<std::uint8_t>(page);
        drv_signal_put(&its, out.data, 64, counter + (counts_frames ? frames : sample));
        drv_signal_put(&number, out.data, 64, sample);
        drv_signal_put(&more, out.data, 64, sample);
        return out;
    }
};

/// 1,000 samples of which some frames are lost. @return the marks that are missing or too many
std::int64_t play(const node& from, double lost, std::mt19937& random, grid_bus_counts* counts = nullptr) {
    const live_config config = make_config(from.first, from.asked, from.bits, from.plain);
    rows out;
    out.width = config.channels.size();
    grid on(config, out);
    std::int64_t missing = 0;
    for (std::int64_t n = 0; n < 1000; ++n)
        for (std::size_t page = n == 0 ? from.joined : 0; page < from.sent; ++page) {
            const bool asked = page >= from.first && page < from.first + from.asked;
            if (n > 300 && n < 990 && std::uniform_real_distribution<double>(0, 1)(random) < lost) {
                missing += asked + (asked && from.plain && from.counts_frames && page == from.first);
                continue;
            }
            on.push(from.frame(n, page));
        }
    on.finish();
    if (counts) *counts = on.bus(0);
    const std::int64_t begins = from.joined > from.first ? 1 : 0;
    TEST_ASSERT_EQUAL_INT64(0, out.wrong);
    TEST_ASSERT_EQUAL_INT64(1000 - begins, out.all.size());
    TEST_ASSERT_EQUAL_INT64(begins, out.base);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(0).duplicate + on.bus(0).out_of_order + on.bus(0).decode_errors);
    return out.marked - missing;
}

void test_what_the_counter_counts(void) {
    std::mt19937 random(3);
    for (const bool frames : {false, true})
        for (const bool back_to_back : {false, true})
            for (std::size_t joined = 0; joined < 4; ++joined)
                for (const unsigned bits : {8U, 16U}) {
                    node one;
                    one.counts_frames = frames;
                    one.back_to_back = back_to_back;
                    one.joined = joined;
                    one.bits = bits;
                    one.counter = 250; // it wraps
                    TEST_ASSERT_EQUAL_INT64(0, play(one, 0, random));
                }
}

void test_losses_are_those_that_were_made(void) {
    std::mt19937 random(4);
    const unsigned runs = draw_seeds(20, 200);
    for (unsigned run = 0; run < runs; ++run) {
        node one;
        one.counts_frames = run % 2;
        one.back_to_back = run % 3;
        one.joined = run / 2 % 4;
        one.counter = static_cast<std::int64_t>(random() % 65536);
        one.plain = run % 4 == 1;
        TEST_ASSERT_EQUAL_INT64(0, play(one, run % 5 ? 0.02 : 0.2, random));
    }
}

/// Channels of one page or two in the middle; the others are ignored.
void test_some_pages(void) {
    std::mt19937 random(5);
    for (const std::size_t asked : {1U, 2U})
        for (std::size_t joined = 0; joined < 4; ++joined)
            for (const bool frames : {false, true}) {
                node one;
                one.first = 1;
                one.asked = asked;
                one.joined = joined;
                one.counts_frames = frames;
                TEST_ASSERT_EQUAL_INT64(0, play(one, 0.02, random));
            }
}

/// A page that comes with every second sample, and a counter of samples: every second sample lacks it.
void test_a_page_of_half_the_rate(void) {
    const live_config config = make_config(0, 1, 16, false);
    rows out;
    out.width = 1;
    grid on(config, out);
    node one;
    one.counts_frames = false;
    for (std::int64_t n = 0; n < 1000; n += 2) on.push(one.frame(n, 0));
    on.finish();
    TEST_ASSERT_EQUAL_INT64(0, out.wrong);
    TEST_ASSERT_EQUAL_INT64(999, out.all.size());
    TEST_ASSERT_EQUAL_INT64(499, out.marked);
}

/// A silence in which a counter of frames, of eight bits, went round many times: the clock tells how often.
void test_a_pause_of_all_pages(void) {
    for (const std::int64_t pause : {2600, 3000, 3033, 20000}) {
        const live_config config = make_config(0, 4, 8, false);
        rows out;
        out.width = 4;
        grid on(config, out);
        node one;
        one.bits = 8;
        for (std::int64_t n = 0; n < 700 + pause; ++n)
            for (std::size_t page = 0; page < 4; ++page)
                if (n < 400 || n >= 400 + pause) on.push(one.frame(n, page));
        on.finish();
        TEST_ASSERT_EQUAL_INT64(4 * pause, out.marked);
        TEST_ASSERT_EQUAL_INT64(out.bulk, out.wrong); // what is missing in one piece
        TEST_ASSERT_EQUAL_INT64(700 + pause, static_cast<std::int64_t>(out.all.size()) + out.bulk);
    }
}

} // namespace

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_what_the_counter_counts);
    RUN_TEST(test_losses_are_those_that_were_made);
    RUN_TEST(test_some_pages);
    RUN_TEST(test_a_page_of_half_the_rate);
    RUN_TEST(test_a_pause_of_all_pages);
    return UNITY_END();
}
