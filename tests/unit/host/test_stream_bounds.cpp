// SPDX-License-Identifier: MIT
// Each number by which the first frames of a stream are judged, from both sides; and what is said of identifiers.
#include "align/stream_check.hpp"
#include "grid_frames.hpp"

#include <functional>
#include <optional>
#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

/// Message 0x101 of the first of three buses: a counter in bits 0 ... 15, where it has one, and a signal.
live_config make_config(bool counted, const drv_signal_t& signal) {
    live_config config;
    config.buses.resize(3);
    config.channels = {channel_at(0x101, signal)};
    config.channels[0].name = "acc1";
    config.channels[0].role = channel_role::acceleration;
    if (counted) config.channels[0].sequence = bits_at(0, 16);
    return config;
}

drv_frame_t make_frame(std::uint32_t id, bool extended = false, std::uint8_t bus = 0) {
    drv_frame_t out{};
    out.id = id;
    out.bus = bus;
    out.flags = extended ? DRV_FRAME_EXTENDED : 0;
    out.len = 8;
    return out;
}

std::string codes_of(const stream_check& check) {
    std::string out;
    for (const auto& [code, text] : check.doubts()) out += code + " ";
    return out;
}

/// What is said of so many frames whose counter rises by one in `good` steps and by two in the others; `page`: of a
/// multiplexed message.
std::string of_counter(std::int64_t frames, std::int64_t good, bool page) {
    live_config config = make_config(true, bits_at(16, 16, true));
    if (page) config.channels[0].selectors.push_back({bits_at(48, 8), {{0, 0}}});
    stream_check check(config);
    const drv_signal_t counter = bits_at(0, 16);
    std::int64_t at = 65500;
    for (std::int64_t n = 0; n < frames; ++n) {
        drv_frame_t frame = make_frame(0x101);
        drv_signal_put(&counter, frame.data, 8, at & 0xFFFF);
        at += n < good ? 1 : 2;
        check.add(frame);
    }
    return codes_of(check);
}

/// What is said of these codes, padded with `rest` to so many.
std::string of_codes(const drv_signal_t& signal, std::vector<std::int64_t> codes, std::int64_t rest, std::size_t count,
                     channel_role role = channel_role::acceleration) {
    live_config config = make_config(false, signal);
    config.channels[0].role = role;
    stream_check check(config);
    codes.resize(count, rest);
    for (const std::int64_t code : codes) {
        drv_frame_t frame = make_frame(0x101);
        drv_signal_put(&signal, frame.data, 8, code);
        check.add(frame);
    }
    return codes_of(check);
}

/// `times` jumps from high to low and back, and `middle` numbers between them at the end.
std::vector<std::int64_t> to_and_fro(std::int64_t low, std::int64_t high, std::size_t times, std::size_t middle,
                                     std::int64_t between) {
    std::vector<std::int64_t> out(1, low);
    for (std::size_t k = 0; k < times; ++k) out.push_back(k % 2 ? low : high);
    out.insert(out.end(), middle, between);
    return out;
}

} // namespace

static void test_a_message_is_judged_by_its_first_2000_frames(void) {
    const live_config config = make_config(true, bits_at(16, 16, true));
    stream_check check(config);
    for (int n = 0; n < 1999; ++n) check.add(make_frame(0x101));
    TEST_ASSERT_FALSE(check.judged());
    TEST_ASSERT_EQUAL_INT64(1999, check.frames_of(0));
    check.add(make_frame(0x101));
    TEST_ASSERT_TRUE(check.judged());
    TEST_ASSERT_EQUAL_INT64(2000, check.frames_of(0));
}

static void test_a_counter_counts_at_half_of_200_steps(void) {
    for (const bool page : {false, true}) {
        TEST_ASSERT_EQUAL_STRING("counter_erratic ", of_counter(201, 99, page).c_str());
        TEST_ASSERT_EQUAL_STRING("", of_counter(200, 99, page).c_str()); // 199 steps say nothing
        TEST_ASSERT_EQUAL_STRING("", of_counter(201, 100, page).c_str());
        TEST_ASSERT_EQUAL_STRING("", of_counter(201, 200, page).c_str());
    }
    TEST_ASSERT_EQUAL_STRING("counter_erratic ", of_counter(201, 0, false).c_str());
    TEST_ASSERT_EQUAL_STRING("", of_counter(201, 0, true).c_str()); // its counter counts two pages
}

/// More than half the range at more than a tenth of the steps, though most codes are in the middle.
static void test_jumps_at_a_tenth_of_the_steps(void) {
    const drv_signal_t signal = bits_at(16, 16, true), positive = bits_at(16, 16);
    const auto jumps = [](std::size_t times, std::int64_t low, std::int64_t high) {
        return to_and_fro(low, high, times, 0, 0);
    };
    TEST_ASSERT_EQUAL_STRING("", of_codes(signal, jumps(20, -20000, 20000), 0, 201).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", of_codes(signal, jumps(21, -20000, 20000), 0, 201).c_str());
    TEST_ASSERT_EQUAL_STRING("", of_codes(signal, jumps(21, -20000, 20000), 0, 200).c_str());
    TEST_ASSERT_EQUAL_STRING("", of_codes(signal, jumps(80, -16384, 16384), 0, 201).c_str()); // just half the range
    TEST_ASSERT_EQUAL_STRING("code_jumps ", of_codes(signal, jumps(80, -16384, 16385), 0, 201).c_str());
    TEST_ASSERT_EQUAL_STRING("", of_codes(positive, jumps(80, 16384, 49152), 32768, 201).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", of_codes(positive, jumps(80, 16383, 49152), 32768, 201).c_str());
    TEST_ASSERT_EQUAL_STRING(
        "", of_codes(signal, jumps(80, -20000, 20000), 0, 201, channel_role::aux).c_str());        // no signal
    TEST_ASSERT_EQUAL_STRING("", of_codes(positive, jumps(20, 60000, 10000), 32768, 201).c_str()); // the first is none
}

/// A sign that is misread: ten jumps, and fewer codes in the middle half of the range than that.
static void test_few_jumps_of_codes_that_are_never_in_the_middle(void) {
    const drv_signal_t signal = bits_at(16, 16, true), positive = bits_at(16, 16);
    const auto said = [&](std::size_t times, std::size_t middle, std::int64_t between) {
        return of_codes(signal, to_and_fro(20000, -20000, times, middle, between), -20000, 400);
    };
    TEST_ASSERT_EQUAL_STRING("", said(9, 0, 0).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", said(11, 0, 0).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", said(11, 10, 0).c_str());
    TEST_ASSERT_EQUAL_STRING("", said(11, 11, 0).c_str());
    TEST_ASSERT_EQUAL_STRING("", said(11, 11, -16384).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", said(11, 11, -16385).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ",
                             of_codes(signal, to_and_fro(-20000, 20000, 10, 0, 0), -20000, 400).c_str()); // just ten
    const auto plain = [&](std::int64_t between) {
        return of_codes(positive, to_and_fro(10000, 60000, 11, 12, between), 60000, 400);
    };
    TEST_ASSERT_EQUAL_STRING("", plain(49151).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", plain(49152).c_str());
}

/// Codes of fewer than six bits may jump; of more than 62 nothing is asked, nor of floating-point numbers.
static void test_the_lengths_of_codes_that_are_looked_at(void) {
    const auto said = [](std::uint16_t length) {
        const std::int64_t most = (std::int64_t{1} << (length - 1)) - 1;
        return of_codes(bits_at(0, length, true), to_and_fro(-most, most, 300, 0, 0), 0, 301);
    };
    TEST_ASSERT_EQUAL_STRING("", said(5).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", said(6).c_str());
    TEST_ASSERT_EQUAL_STRING("code_jumps ", said(62).c_str());
    TEST_ASSERT_EQUAL_STRING("", said(63).c_str());
    drv_signal_t number = bits_at(0, 32, true);
    number.value = DRV_VALUE_FLOAT32;
    TEST_ASSERT_EQUAL_STRING("", of_codes(number, to_and_fro(-1000, 1000, 300, 0, 0), 0, 301).c_str());
}

/// Every message has to be judged before nothing is looked at any more.
static void test_each_message_has_its_own_frames(void) {
    live_config config = make_config(true, bits_at(16, 16, true));
    config.channels.push_back(config.channels[0]);
    config.channels[1].name = "acc2"; // in the same frames
    config.channels.push_back(config.channels[0]);
    config.channels[2].name = "acc3";
    config.channels[2].frame = {0x102, 1, 0};
    config.channels[2].bus = 1;
    stream_check check(config);
    TEST_ASSERT_EQUAL_STRING("0x101 (acc1, acc2)", check.unheard(0).c_str());
    TEST_ASSERT_EQUAL_STRING("0x102 extended (acc3)", check.unheard(1).c_str());
    for (int n = 0; n < 2000; ++n) check.add(make_frame(0x101));
    TEST_ASSERT_FALSE(check.judged());
    TEST_ASSERT_EQUAL_INT64(2000, check.frames_of(1));
    TEST_ASSERT_EQUAL_INT64(0, check.frames_of(2));
    TEST_ASSERT_EQUAL_STRING("", check.unheard(0).c_str());
    for (int n = 0; n < 2000; ++n) check.add(make_frame(0x102, true, 1));
    TEST_ASSERT_TRUE(check.judged());
}

static void test_eight_others_are_named(void) {
    for (const std::uint32_t count : {8u, 9u}) {
        const live_config config = make_config(true, bits_at(16, 16, true));
        stream_check check(config);
        for (std::uint32_t k = 0; k < count; ++k) check.add(make_frame(0x300 + count - k));
        check.add(make_frame(0x305));
        check.add(make_frame(0x305, true));     // another one
        check.add(make_frame(0x305, true, 1));  // and another
        check.add(make_frame(0x306, false, 3)); // of no bus
        const std::string text = check.others(0);
        TEST_ASSERT_EQUAL_INT(0, text.rfind("0x305 (2 frames), 0x301 (1 frame), 0x302 (1 frame), ", 0));
        TEST_ASSERT_TRUE(text.find(" and more") != std::string::npos); // with the extended one they are nine
        TEST_ASSERT_EQUAL_STRING("0x305 extended (1 frame)", check.others(1).c_str());
        TEST_ASSERT_EQUAL_STRING("", check.others(2).c_str());
    }
    const live_config config = make_config(true, bits_at(16, 16, true));
    stream_check check(config);
    for (std::uint32_t k = 0; k < 8; ++k) check.add(make_frame(0x300 + k));
    TEST_ASSERT_EQUAL_STRING("0x300 (1 frame), 0x301 (1 frame), 0x302 (1 frame), 0x303 (1 frame), 0x304 (1 frame), "
                             "0x305 (1 frame), 0x306 (1 frame), 0x307 (1 frame)",
                             check.others(0).c_str());
    check.add(make_frame(0x308));
    TEST_ASSERT_TRUE(check.others(0).find("0x308") == std::string::npos);
    TEST_ASSERT_TRUE(check.others(0).find("0x307 (1 frame) and more") != std::string::npos);
}

/// The table has room for 32; a bus with one too many has more.
static void test_a_full_table_is_owned_to(void) {
    const live_config config = make_config(true, bits_at(16, 16, true));
    stream_check check(config);
    check.add(make_frame(0x300));
    for (std::uint32_t k = 0; k < 31; ++k) check.add(make_frame(0x400 + k, false, 1));
    check.add(make_frame(0x300));
    TEST_ASSERT_EQUAL_STRING("0x300 (2 frames)", check.others(0).c_str());
    TEST_ASSERT_EQUAL_STRING("", check.others(2).c_str());
    check.add(make_frame(0x301));
    TEST_ASSERT_EQUAL_STRING("0x300 (2 frames) and more", check.others(0).c_str());
    TEST_ASSERT_EQUAL_STRING("", check.others(2).c_str());
}

/// A J1939 message of which another sender's, or another priority's came.
static void test_the_group_of_an_identifier_that_did_not_come(void) {
    live_config config = make_config(true, bits_at(16, 16, true));
    config.channels[0].frame = {0x18FEE517, 1, 0};
    {
        stream_check check(config);
        check.add(make_frame(0x18FEE617, true));    // another group
        check.add(make_frame(0x8FEE5, false));      // no extended one
        check.add(make_frame(0x0CFEE521, true, 1)); // another bus
        TEST_ASSERT_EQUAL_STRING("", check.same_group(0).c_str());
        check.add(make_frame(0x0CFEE521, true));
        TEST_ASSERT_EQUAL_INT(
            0, check.same_group(0).rfind("0xcfee521 of the same J1939 group was received: give pgn = 65253,", 0));
        TEST_ASSERT_EQUAL_INT(0, check.unheard(0).rfind("0x18fee517 extended (acc1; 0xcfee521 of the same", 0));
    }
    config.channels[0].frame = {0x00FEE517, 1, 0x03FFFFFF};
    {
        stream_check check(config);
        check.add(make_frame(0x0CFEE521, true));
        TEST_ASSERT_EQUAL_STRING("address 0x21 sends this group: is source_address right?",
                                 check.same_group(0).c_str());
    }
    config.channels[0].frame = {0x101, 0, 0};
    {
        stream_check check(config);
        check.add(make_frame(0x00000121, true)); // group 1, as 0x101 would be
        TEST_ASSERT_EQUAL_STRING("", check.same_group(0).c_str());
    }
}

/// A group without an address takes all senders of it; two of them are one too many.
static void test_the_senders_of_a_group(void) {
    const auto said = [](std::uint32_t mask, const std::vector<std::uint32_t>& addresses) {
        live_config config = make_config(false, bits_at(16, 16, true));
        config.channels[0].frame = {0x00FEE500 | (mask & 0xFF ? 0x17u : 0u), 1, mask};
        stream_check check(config);
        for (const std::uint32_t address : addresses) check.add(make_frame(0x18FEE500 | address, true));
        std::string out;
        for (const auto& [code, text] : check.doubts()) out += code + ": " + text;
        return out;
    };
    TEST_ASSERT_EQUAL_STRING("", said(0x03FFFF00, {0x17, 0x17}).c_str());
    TEST_ASSERT_EQUAL_STRING("", said(0x03FFFFFF, {0x17, 0x18}).c_str());
    const std::string text = said(0x03FFFF00, {0x00, 0xFF, 0x17});
    TEST_ASSERT_EQUAL_INT(0, text.rfind("several_senders: parameter group 65253 of \"acc1\" is sent by the addresses "
                                        "0x0, 0x17, 0xff:",
                                        0));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_message_is_judged_by_its_first_2000_frames);
    RUN_TEST(test_a_counter_counts_at_half_of_200_steps);
    RUN_TEST(test_jumps_at_a_tenth_of_the_steps);
    RUN_TEST(test_few_jumps_of_codes_that_are_never_in_the_middle);
    RUN_TEST(test_the_lengths_of_codes_that_are_looked_at);
    RUN_TEST(test_each_message_has_its_own_frames);
    RUN_TEST(test_eight_others_are_named);
    RUN_TEST(test_a_full_table_is_owned_to);
    RUN_TEST(test_the_group_of_an_identifier_that_did_not_come);
    RUN_TEST(test_the_senders_of_a_group);
    return UNITY_END();
}
