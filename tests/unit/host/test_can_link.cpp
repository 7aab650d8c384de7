// SPDX-License-Identifier: MIT
// What okid doctor and okid run say of a CAN interface, for states that no virtual one can have.
#include "acquire/bus_watch.hpp"
#include "acquire/can_link.hpp"

#include <cstring>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

bus_config bus() {
    bus_config out;
    out.name = "b";
    out.interface = "can0";
    out.bitrate = 500000;
    return out;
}

drv_link_t good() {
    drv_link_t out{};
    std::strcpy(out.kind, "can");
    out.is_can = out.up = out.running = out.has_can_data = 1;
    out.mtu = 16;
    out.tx_queue = 1000;
    out.state = DRV_BUS_ACTIVE;
    out.bitrate = 500000;
    out.restart_ms = 100;
    return out;
}

/// The only finding that stands in the way.
link_finding fault(const bus_config& b, const drv_link_t& link) {
    link_finding out;
    int count = 0;
    for (const link_finding& each : judge_link(b, link))
        if (each.missing) {
            out = each;
            ++count;
        }
    TEST_ASSERT_EQUAL_INT(1, count);
    return out;
}

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

} // namespace

static void test_all_is_well() {
    const auto found = judge_link(bus(), good());
    TEST_ASSERT_EQUAL_INT(1, found.size());
    TEST_ASSERT_FALSE(found[0].missing);
    TEST_ASSERT_EQUAL_STRING("up, 500000 bit/s, error-active", found[0].found.c_str());
    drv_link_t virtual_one{};
    virtual_one.is_can = virtual_one.up = 1;
    virtual_one.mtu = 72;
    TEST_ASSERT_EQUAL_INT(1, judge_link(bus(), virtual_one).size());
}

static void test_what_stands_in_the_way() {
    drv_link_t link = good();
    link.is_can = 0;
    TEST_ASSERT_TRUE(contains(fault(bus(), link).found, "no CAN interface"));
    link = good();
    link.up = 0;
    TEST_ASSERT_EQUAL_STRING(
        "sudo ip link set can0 down; sudo ip link set can0 up type can bitrate 500000 restart-ms 100",
        fault(bus(), link).remedy.c_str());
    std::strcpy(link.kind, "vcan");
    TEST_ASSERT_EQUAL_STRING("sudo ip link set can0 up", fault(bus(), link).remedy.c_str());
    link = good();
    link.state = DRV_BUS_OFF;
    TEST_ASSERT_EQUAL_STRING("sudo ip link set can0 type can restart", fault(bus(), link).remedy.c_str());
    link = good();
    link.bitrate = 250000;
    TEST_ASSERT_TRUE(contains(fault(bus(), link).found, "expected 500000 bit/s"));
    TEST_ASSERT_TRUE(contains(fault(bus(), link).remedy, "bitrate 500000"));
    bus_config fd = bus();
    fd.fd = true;
    fd.dbitrate = 2000000;
    TEST_ASSERT_TRUE(contains(fault(fd, good()).remedy, "dbitrate 2000000 fd on"));
    link = good();
    link.mtu = 72;
    link.dbitrate = 4000000;
    TEST_ASSERT_TRUE(contains(fault(fd, link).found, "expected 2000000 bit/s for data"));
    bus_config sends = bus();
    sends.sync_hz = 100;
    link = good();
    link.tx_queue = 10;
    TEST_ASSERT_TRUE(contains(fault(sends, link).remedy, "txqueuelen 1000"));
    link = good();
    link.listen_only = 1;
    TEST_ASSERT_TRUE(contains(fault(sends, link).remedy, "listen-only off"));
}

static void test_remarks() {
    drv_link_t link = good();
    link.restart_ms = 0;
    link.tx_queue = 10;
    link.state = DRV_BUS_PASSIVE;
    link.has_error_counters = 1;
    link.tx_errors = 130;
    link.rx_dropped = 4;
    const auto found = judge_link(bus(), link);
    TEST_ASSERT_EQUAL_INT(5, found.size());
    for (const link_finding& each : found) TEST_ASSERT_FALSE(each.missing);
    TEST_ASSERT_EQUAL_STRING("up, 500000 bit/s, error-passive, error counters tx 130 rx 0", found[0].found.c_str());
    TEST_ASSERT_TRUE(contains(found[1].remedy, "txqueuelen"));
    TEST_ASSERT_TRUE(contains(found[3].remedy, "restart-ms 100"));
    TEST_ASSERT_TRUE(contains(found[4].found, "dropped 4 frames"));
}

static void test_events_of_a_bus() {
    bus_watch watch("can0");
    drv_stats_t now{};
    TEST_ASSERT_EQUAL_INT(0, watch.look(now).size());
    now.link_down = 1;
    now.link_is_down = 1;
    auto events = watch.look(now);
    TEST_ASSERT_EQUAL_INT(1, events.size());
    TEST_ASSERT_EQUAL_STRING("link_down", events[0].kind);
    now.link_is_down = 0;
    events = watch.look(now);
    TEST_ASSERT_EQUAL_INT(1, events.size());
    TEST_ASSERT_EQUAL_STRING("link_up", events[0].kind);
    now.link_down = 2; // down and up between two looks
    TEST_ASSERT_EQUAL_INT(2, watch.look(now).size());
    now.bus_off = 1;
    events = watch.look(now);
    TEST_ASSERT_TRUE(contains(events.at(0).text, "restart-ms is 0"));
    now.bus_off = 2;
    now.restart_ms = 100;
    now.restarts = 1;
    events = watch.look(now);
    TEST_ASSERT_EQUAL_INT(2, events.size());
    TEST_ASSERT_TRUE(contains(events[0].text, "after 100 ms"));
    TEST_ASSERT_EQUAL_STRING("restarted", events[1].kind);
    now.lost_overflow = 5;
    now.lost_driver = 6;
    now.no_ack = 7;
    now.error_passive = 8;
    events = watch.look(now);
    TEST_ASSERT_EQUAL_INT(4, events.size());
    for (const bus_event& event : events) TEST_ASSERT_TRUE(event.urgent);
    now.lost_overflow = now.lost_driver = now.no_ack = now.error_passive = 9;
    events = watch.look(now);
    TEST_ASSERT_EQUAL_INT(4, events.size());
    for (const bus_event& event : events) TEST_ASSERT_FALSE(event.urgent);
    TEST_ASSERT_EQUAL_INT(0, watch.look(now).size());
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_all_is_well);
    RUN_TEST(test_what_stands_in_the_way);
    RUN_TEST(test_remarks);
    RUN_TEST(test_events_of_a_bus);
    return UNITY_END();
}
