// SPDX-License-Identifier: MIT
// Which channels a frame belongs to: by bus, identifier, parameter group and page. Every frame carries its own number.
#include "grid_frames.hpp"

#include <string>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

/// A counter of 16 bits, a page in the byte behind it, a number from byte 4 on.
channel_config channel_of(std::size_t bus, std::uint32_t id, bool extended, std::uint32_t mask = 0) {
    channel_config out = channel_at(id, bits_at(32, 32), bits_at(0, 16));
    out.bus = bus;
    out.frame.extended = extended;
    out.frame.mask = mask;
    return out;
}

drv_frame_t frame_of(std::size_t bus, std::uint32_t id, bool extended, std::int64_t sample, std::int64_t number) {
    drv_frame_t out{};
    out.bus = static_cast<std::uint8_t>(bus);
    out.id = id;
    out.flags = extended ? DRV_FRAME_EXTENDED : 0;
    out.len = 8;
    out.time_ns = day_ns + sample * 1000000;
    const drv_signal_t counter = bits_at(0, 16), at = bits_at(32, 32);
    drv_signal_put(&counter, out.data, 8, sample);
    drv_signal_put(&at, out.data, 8, number);
    return out;
}

live_config config_of(std::vector<channel_config> channels, std::size_t buses) {
    live_config out;
    out.rate_hz = 1000;
    out.buses.resize(buses);
    for (std::size_t i = 0; i < channels.size(); ++i) channels[i].name = "c" + std::to_string(i);
    out.channels = std::move(channels);
    return out;
}

} // namespace

/// Equal identifiers on many buses, with and without the long form, and many that differ in few bits.
static void test_every_identifier_of_every_bus_has_its_channel(void) {
    constexpr std::size_t buses = 9;
    std::vector<channel_config> channels;
    for (std::size_t bus = 0; bus < buses; ++bus) {
        for (const std::uint32_t id : {0x000u, 0x001u, 0x100u, 0x7FFu}) channels.push_back(channel_of(bus, id, false));
        for (const std::uint32_t id : {0x000u, 0x100u, 0x800u, 0x900u, 0x1100u, 0x1FFFFFFFu})
            channels.push_back(channel_of(bus, id, true));
    }
    const live_config config = config_of(channels, buses);
    row_recorder out(channels.size());
    grid on(config, out);
    for (std::int64_t n = 0; n < 50; ++n)
        for (std::size_t c = 0; c < channels.size(); ++c) {
            const channel_config& its = channels[c];
            on.push(
                frame_of(its.bus, its.frame.id, its.frame.extended != 0, n, 1000 * n + static_cast<std::int64_t>(c)));
            on.push(frame_of(its.bus, 0x222, false, n, 7)); // of no channel
            on.push(frame_of(buses, its.frame.id, its.frame.extended != 0, n, 7));
        }
    on.finish();
    TEST_ASSERT_EQUAL_UINT64(50, out.rows.size());
    for (std::size_t n = 0; n < out.rows.size(); ++n)
        for (std::size_t c = 0; c < channels.size(); ++c)
            TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(1000 * n + c), out.rows[n][c]);
    for (std::size_t bus = 0; bus < buses; ++bus) {
        TEST_ASSERT_EQUAL_UINT64(500, on.bus(bus).received);
        TEST_ASSERT_EQUAL_UINT64(0, on.bus(bus).duplicate + on.bus(bus).decode_errors + on.bus(bus).out_of_order);
    }
}

/// The exact identifier first, then the group of one sender, then that of all.
static void test_a_group_takes_what_nothing_stricter_asks_for(void) {
    for (const bool turned : {false, true}) {
        std::vector<channel_config> channels = {channel_of(0, 0x00FEE500, true, 0x03FFFF00),
                                                channel_of(0, 0x00FEE517, true, 0x03FFFFFF),
                                                channel_of(0, 0x18FEE517, true)};
        if (turned) std::swap(channels[0], channels[1]);
        const live_config config = config_of(channels, 1);
        row_recorder out(3);
        grid on(config, out);
        for (std::int64_t n = 0; n < 40; ++n) {
            on.push(frame_of(0, 0x18FEE517, true, n, 3 * n));
            on.push(frame_of(0, 0x0CFEE517, true, n, 3 * n + 1));
            on.push(frame_of(0, 0x0CFEE521, true, n, 3 * n + 2));
            on.push(frame_of(0, 0x0CFEE621, true, n, 7)); // another group
            on.push(frame_of(0, 0x500, false, n, 7));
        }
        on.finish();
        TEST_ASSERT_EQUAL_UINT64(40, out.rows.size());
        for (std::size_t n = 0; n < out.rows.size(); ++n) {
            TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(3 * n + 2), out.rows[n][turned ? 1 : 0]);
            TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(3 * n + 1), out.rows[n][turned ? 0 : 1]);
            TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(3 * n), out.rows[n][2]);
        }
        TEST_ASSERT_EQUAL_UINT64(120, on.bus(0).received);
    }
}

/// A page and what is in every page are two lanes of one message: a frame of it is one frame received.
static void test_a_frame_of_two_lanes_is_received_once(void) {
    std::vector<channel_config> channels(3, channel_of(0, 0x100, false));
    channels[1].selectors.push_back({bits_at(16, 8), {{0, 0}}});
    channels[2].selectors.push_back({bits_at(16, 8), {{0, 9}}});
    for (channel_config& each : channels) each.sequence.reset();
    const live_config config = config_of(channels, 1);
    row_recorder out(3);
    grid on(config, out);
    for (std::int64_t n = 0; n < 2000; ++n) on.push(frame_of(0, 0x100, false, n, n));
    on.finish();
    TEST_ASSERT_EQUAL_UINT64(2000, on.bus(0).received);
    TEST_ASSERT_EQUAL_UINT64(2000, out.rows.size());
    for (std::size_t n = 0; n < out.rows.size(); ++n)
        for (const double number : out.rows[n]) TEST_ASSERT_EQUAL_DOUBLE(static_cast<double>(n), number);
}

/// A loss is one of the bus it was reported on, however many buses there are.
static void test_a_reported_loss_belongs_to_its_bus(void) {
    const live_config config = config_of({channel_of(0, 0x100, false), channel_of(1, 0x100, false)}, 2);
    row_recorder out(2);
    grid on(config, out);
    for (std::int64_t n = 0; n < 300; ++n)
        for (std::size_t bus = 0; bus < 2; ++bus) {
            if (n >= 100 && n < 105) continue;
            drv_frame_t frame = frame_of(bus, 0x100, false, n, n);
            if (n == 105 && bus == 1) frame.loss = DRV_LOSS_OVERFLOW;
            on.push(frame);
        }
    on.finish();
    TEST_ASSERT_EQUAL_INT64(10, out.marked());
    TEST_ASSERT_EQUAL_UINT64(5, on.bus(0).lost[static_cast<std::size_t>(gap_cause::sequence)]);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(0).lost[static_cast<std::size_t>(gap_cause::socket_overflow)]);
    TEST_ASSERT_EQUAL_UINT64(5, on.bus(1).lost[static_cast<std::size_t>(gap_cause::socket_overflow)]);
    TEST_ASSERT_EQUAL_UINT64(0, on.bus(1).lost[static_cast<std::size_t>(gap_cause::sequence)]);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_identifier_of_every_bus_has_its_channel);
    RUN_TEST(test_a_group_takes_what_nothing_stricter_asks_for);
    RUN_TEST(test_a_frame_of_two_lanes_is_received_once);
    RUN_TEST(test_a_reported_loss_belongs_to_its_bus);
    return UNITY_END();
}
