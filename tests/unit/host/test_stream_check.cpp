// SPDX-License-Identifier: MIT
// What the first frames of a stream say against the configuration, and that a right one gives no cause.
#include "align/stream_check.hpp"
#include "grid_frames.hpp"

#include <cmath>
#include <random>
#include <string>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr std::int64_t frames = 2500;

/// One message 0x101 on the first of two buses: a counter in the first 16 bits, a signal in the next.
live_config make_config(const drv_signal_t& counter, const drv_signal_t& signal) {
    live_config config;
    config.buses.resize(2);
    config.channels = {channel_at(0x101, signal, counter)};
    config.channels[0].name = "acc1";
    config.channels[0].role = channel_role::acceleration;
    return config;
}

drv_frame_t make_frame(std::uint32_t id, std::int64_t counter, std::int64_t code) {
    drv_frame_t frame{};
    frame.id = id;
    frame.len = 8;
    const drv_signal_t first = bits_at(0, 16), second = bits_at(16, 16, true);
    drv_signal_put(&first, frame.data, 8, counter & 0xffff);
    drv_signal_put(&second, frame.data, 8, code);
    return frame;
}

/// A tenth of full scale, 16 bits, signed: noise, or a slow sine of 5 Hz at 1000 samples a second.
std::string codes_of(const live_config& config, bool slow, double amplitude = 3000) {
    stream_check check(config);
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise;
    for (std::int64_t n = 0; n < frames; ++n) {
        const double x = slow ? std::sin(0.0314159 * static_cast<double>(n)) + 0.01 * noise(random) : noise(random);
        check.add(make_frame(0x101, 65000 + n, std::llround(amplitude * x)));
    }
    std::string out;
    for (const auto& [code, text] : check.doubts()) out += code + " ";
    return out;
}

const drv_signal_t right_counter = bits_at(0, 16), right_signal = bits_at(16, 16, true);

void test_nothing_to_say(void) {
    TEST_ASSERT_EQUAL_STRING("", codes_of(make_config(right_counter, right_signal), false).c_str());
    TEST_ASSERT_EQUAL_STRING("", codes_of(make_config(right_counter, right_signal), true).c_str());
    // noise of a third of full scale
    TEST_ASSERT_EQUAL_STRING("", codes_of(make_config(right_counter, right_signal), false, 10900).c_str());
    // the low byte of a counter counts as well
    TEST_ASSERT_EQUAL_STRING("", codes_of(make_config(bits_at(0, 8), right_signal), false).c_str());
}

/// As wide as a frame has room for, and past its end: it goes on at zero.
void test_a_counter_of_64_bits(void) {
    const drv_signal_t wide = bits_at(0, 64);
    const live_config config = make_config(wide, right_signal); // which outlives the check
    stream_check check(config);
    for (std::int64_t n = 0; n < frames; ++n) {
        drv_frame_t frame = make_frame(0x101, 0, 0);
        drv_signal_put(&wide, frame.data, 8, n - 500);
        check.add(frame);
    }
    TEST_ASSERT_TRUE(check.judged());
    TEST_ASSERT_EQUAL_INT(0, check.doubts().size());
}

void test_misread_sign(void) {
    const live_config config = make_config(right_counter, bits_at(16, 16));
    TEST_ASSERT_EQUAL_STRING("code_jumps ", codes_of(config, false).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", codes_of(config, true).c_str());
}

void test_misread_bits(void) {
    TEST_ASSERT_EQUAL_STRING("code_jumps ",
                             codes_of(make_config(right_counter, bits_at(23, 16, true, true)), false).c_str());
    TEST_ASSERT_EQUAL_STRING("counter_erratic ", codes_of(make_config(bits_at(16, 16), right_signal), false).c_str());
    TEST_ASSERT_EQUAL_STRING("counter_erratic ",
                             codes_of(make_config(bits_at(7, 16, false, true), right_signal), false).c_str());
}

/// Half of the frames lost in bursts is a bad bus, not a wrong counter.
void test_losses_are_no_wrong_counter(void) {
    const live_config config = make_config(right_counter, right_signal);
    stream_check check(config);
    for (std::int64_t n = 0; n < 3 * frames; ++n)
        if (n / 10 % 2 == 0) check.add(make_frame(0x101, n, 5));
    TEST_ASSERT_TRUE(check.judged());
    TEST_ASSERT_EQUAL_INT(0, check.doubts().size());
}

/// Three pages in turn, counted frame by frame or sample by sample, and what is on each of them.
std::string doubts_of_pages(bool counts_frames, const drv_signal_t& counter) {
    live_config config = make_config(counter, right_signal);
    config.channels.push_back(config.channels.front());
    config.channels.back().selectors = {{bits_at(32, 8), {{1, 1}}}};
    stream_check check(config);
    for (std::int64_t n = 0; n < 3 * frames; ++n) {
        drv_frame_t frame = make_frame(0x101, counts_frames ? n : n / 3, 7919 * n % 2003);
        frame.data[4] = static_cast<std::uint8_t>(n % 3);
        check.add(frame);
    }
    std::string out;
    for (const auto& [code, text] : check.doubts()) out += code + " ";
    return out;
}

void test_pages(void) {
    for (const bool counts_frames : {false, true}) {
        TEST_ASSERT_EQUAL_STRING("", doubts_of_pages(counts_frames, right_counter).c_str());
        TEST_ASSERT_EQUAL_STRING("counter_erratic ", doubts_of_pages(counts_frames, right_signal).c_str());
    }
}

void test_too_few_frames_say_nothing(void) {
    const live_config config = make_config(bits_at(16, 16), right_signal);
    stream_check check(config);
    for (std::int64_t n = 0; n < 100; ++n) check.add(make_frame(0x101, n, 1));
    TEST_ASSERT_EQUAL_INT(0, check.doubts().size());
    TEST_ASSERT_FALSE(check.judged());
}

void test_identifiers(void) {
    const live_config config = make_config(right_counter, right_signal);
    stream_check check(config);
    TEST_ASSERT_EQUAL_STRING("0x101 (acc1)", check.unheard(0).c_str());
    TEST_ASSERT_EQUAL_STRING("", check.unheard(1).c_str());
    check.add(make_frame(0x155, 0, 0));
    check.overhear(make_frame(0x155, 0, 0));
    check.overhear(make_frame(0x101, 0, 0)); // asked for: it is counted where it is taken
    drv_frame_t other = make_frame(0x101, 0, 0);
    other.flags = DRV_FRAME_EXTENDED;
    check.add(other);
    drv_frame_t error = make_frame(0x7, 0, 0);
    error.flags = DRV_FRAME_ERROR;
    check.add(error);
    other.bus = 1;
    check.add(other);
    TEST_ASSERT_EQUAL_STRING("0x155 (2 frames), 0x101 extended (1 frame)", check.others(0).c_str());
    TEST_ASSERT_EQUAL_STRING("0x101 extended (1 frame)", check.others(1).c_str());
    TEST_ASSERT_EQUAL_STRING("0x101 (acc1)", check.unheard(0).c_str());
    TEST_ASSERT_EQUAL_INT64(0, check.frames_of(0));
    check.add(make_frame(0x101, 0, 0));
    TEST_ASSERT_EQUAL_STRING("", check.unheard(0).c_str());
    TEST_ASSERT_EQUAL_INT64(1, check.frames_of(0));
}

/// The most frequent are named, however many there are.
void test_many_identifiers(void) {
    const live_config config = make_config(right_counter, right_signal);
    stream_check check(config);
    for (std::uint32_t id = 0x200; id < 0x300; ++id)
        for (std::uint32_t k = 0; k <= (id == 0x210 ? 5u : 0u); ++k) check.add(make_frame(id, 0, 0));
    const std::string text = check.others(0);
    TEST_ASSERT_EQUAL_INT(0, text.rfind("0x210 (6 frames), 0x200 (1 frame)", 0));
    TEST_ASSERT_TRUE(text.find(" and more") != std::string::npos);
    TEST_ASSERT_LESS_THAN(250, text.size());
}

/// An identifier that stands for many (a PGN) takes only what no exact one asks for.
void test_exact_before_alike(void) {
    live_config config = make_config(right_counter, right_signal);
    config.channels[0].frame = {0x18fee500, 1, 0};
    channel_config many = config.channels[0];
    many.name = "acc2";
    many.frame = {0x00fee500, 1, 0x03ffff00};
    config.channels.push_back(many);
    stream_check check(config);
    drv_frame_t frame = make_frame(0x18fee500, 0, 0);
    frame.flags = DRV_FRAME_EXTENDED;
    check.add(frame);
    TEST_ASSERT_EQUAL_INT64(1, check.frames_of(0));
    TEST_ASSERT_EQUAL_INT64(0, check.frames_of(1));
    frame.id = 0x0cfee517;
    check.add(frame);
    TEST_ASSERT_EQUAL_INT64(1, check.frames_of(0));
    TEST_ASSERT_EQUAL_INT64(1, check.frames_of(1));
}

} // namespace

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_nothing_to_say);
    RUN_TEST(test_a_counter_of_64_bits);
    RUN_TEST(test_misread_sign);
    RUN_TEST(test_misread_bits);
    RUN_TEST(test_losses_are_no_wrong_counter);
    RUN_TEST(test_pages);
    RUN_TEST(test_too_few_frames_say_nothing);
    RUN_TEST(test_identifiers);
    RUN_TEST(test_many_identifiers);
    RUN_TEST(test_exact_before_alike);
    return UNITY_END();
}
