// SPDX-License-Identifier: MIT
// The SocketCAN source against a kernel of our own making: every error it can answer, on a machine without CAN.
#include "../../fault/fake_can.h"

#include <drv/source.h>

#include <linux/can/error.h>
#include <poll.h>
#include <stdlib.h>
#include <unity.h>

static drv_source_t source;
static drv_frame_t frames[128];

void setUp(void) {
    fake_reset();
    memset(&source, 0, sizeof source);
    source.ops = &drv_source_socketcan;
}

void tearDown(void) { source.ops->close(&source); }

static int open_source(void) {
    drv_source_config_t config;
    memset(&config, 0, sizeof config);
    config.interfaces[0] = "can0";
    config.interface_count = 1;
    return source.ops->open(&source, &config);
}

static int read_some(void) { return source.ops->read(&source, frames, 128); }

static drv_stats_t stats(void) {
    drv_stats_t out;
    source.ops->stats(&source, &out);
    return out;
}

static int readable(void) {
    struct pollfd wait = {source.ops->fd(&source), POLLIN, 0};
    return poll(&wait, 1, 0) == 1;
}

static fake_item_t item(uint32_t id, uint32_t drops) {
    fake_item_t out;
    memset(&out, 0, sizeof out);
    out.frame.can_id = id;
    out.frame.len = 8;
    out.bytes = CAN_MTU;
    out.drops = drops;
    out.sw_ns = INT64_C(1700000000123456789);
    return out;
}

static void send_error(uint32_t classes, uint8_t controller) {
    fake_item_t out = item(CAN_ERR_FLAG | classes, 0);
    out.frame.data[1] = controller;
    fake_put(out);
}

static void test_refusals(void) {
    fake.socket_error = EAFNOSUPPORT;
    TEST_ASSERT_EQUAL_INT(-EAFNOSUPPORT, open_source());
    TEST_ASSERT_NOT_NULL(strstr(source.error, "this kernel has no CAN"));
    fake.socket_error = EPERM;
    TEST_ASSERT_EQUAL_INT(-EPERM, open_source());
    fake.socket_error = 0;
    fake.index = 0;
    TEST_ASSERT_EQUAL_INT(-ENODEV, open_source());
    TEST_ASSERT_EQUAL_STRING("interface can0: there is no such interface", source.error);
    fake.index = 5;
    fake.type = 1;
    TEST_ASSERT_EQUAL_INT(-ENODEV, open_source());
    TEST_ASSERT_EQUAL_STRING("interface can0: is not a CAN interface", source.error);
    fake.type = ARPHRD_CAN;
    fake.bind_error = EIO;
    TEST_ASSERT_EQUAL_INT(-EIO, open_source());
    fake.bind_error = 0;
    fake.up = 0;
    TEST_ASSERT_EQUAL_INT(-ENETDOWN, open_source());
    TEST_ASSERT_EQUAL_STRING("interface can0: is down", source.error);
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    TEST_ASSERT_EQUAL_INT(-EBADF, read_some());
}

static void test_configurations_that_cannot_be(void) {
    drv_source_config_t config;
    memset(&config, 0, sizeof config);
    TEST_ASSERT_EQUAL_INT(-EINVAL, source.ops->open(&source, &config));
    config.interfaces[0] = "a_name_of_16_chr";
    config.interface_count = 1;
    TEST_ASSERT_EQUAL_INT(-EINVAL, source.ops->open(&source, &config));
    config.interfaces[0] = "can0";
    config.filter_count = DRV_MAX_FILTERS + 1;
    TEST_ASSERT_EQUAL_INT(-EINVAL, source.ops->open(&source, &config));
}

static void test_options(void) {
    const drv_filter_t wanted[] = {{0x123, 0, 0}, {0x18F02D00, 1, 0x3FFFF00}};
    drv_source_config_t config;
    memset(&config, 0, sizeof config);
    config.interfaces[0] = "can0";
    config.interface_count = 1;
    config.filters = wanted;
    config.filter_count = 2;
    fake.no_force = 1;
    TEST_ASSERT_EQUAL_INT(0, source.ops->open(&source, &config));
    TEST_ASSERT_EQUAL_INT(2, fake.filters);
    TEST_ASSERT_EQUAL_HEX32(0x123, fake.filter[0].can_id);
    TEST_ASSERT_EQUAL_HEX32(CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG, fake.filter[0].can_mask);
    TEST_ASSERT_EQUAL_HEX32(0x18F02D00 | CAN_EFF_FLAG, fake.filter[1].can_id);
    TEST_ASSERT_EQUAL_HEX32(0x03FFFF00 | CAN_EFF_FLAG | CAN_RTR_FLAG, fake.filter[1].can_mask);
    TEST_ASSERT_EQUAL_INT(212992, stats().buffer_bytes);
    TEST_ASSERT_EQUAL_INT(DRV_STAMP_NS, stats().stamp);
    TEST_ASSERT_EQUAL_UINT32(500000, stats().bitrate);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_ACTIVE, stats().state);
}

static void test_frames_of_every_kind(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    TEST_ASSERT_FALSE(readable());
    fake_put(item(0x123, 0));
    TEST_ASSERT_TRUE(readable());
    fake_item_t one = item(0x18F02D00 | CAN_EFF_FLAG, 0);
    one.bytes = CANFD_MTU;
    one.frame.len = 64;
    one.frame.flags = CANFD_BRS | CANFD_ESI;
    one.frame.data[63] = 0xAB;
    one.hw_ns = 42000000001;
    fake_put(one);
    fake_put(item(0x100 | CAN_RTR_FLAG, 0));
    one = item(0x7FF, 0);
    one.frame.len = 200; // no kernel gives that
    fake_put(one);
    one.bytes = 9; // nor that
    fake_put(one);
    TEST_ASSERT_EQUAL_INT(3, read_some());
    TEST_ASSERT_EQUAL_HEX32(0x123, frames[0].id);
    TEST_ASSERT_EQUAL_INT64(INT64_C(1700000000123456789), frames[0].time_ns);
    TEST_ASSERT_EQUAL_INT64(0, frames[0].hw_time_ns);
    TEST_ASSERT_EQUAL_HEX32(0x18F02D00, frames[1].id);
    TEST_ASSERT_EQUAL_INT(DRV_FRAME_EXTENDED | DRV_FRAME_FD | DRV_FRAME_BRS | DRV_FRAME_ESI, frames[1].flags);
    TEST_ASSERT_EQUAL_INT64(INT64_C(1700000000123456789), frames[1].time_ns);
    TEST_ASSERT_EQUAL_INT64(42000000001, frames[1].hw_time_ns);
    TEST_ASSERT_EQUAL_INT(0xAB, frames[1].data[63]);
    TEST_ASSERT_EQUAL_INT(8, frames[2].len);
    const drv_stats_t counts = stats();
    TEST_ASSERT_EQUAL_INT(DRV_STAMP_HARDWARE, counts.stamp);
    TEST_ASSERT_EQUAL_UINT64(3, counts.received);
    TEST_ASSERT_EQUAL_UINT64(1, counts.remote);
    TEST_ASSERT_EQUAL_UINT64(1, counts.read_errors);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_FALSE(readable());
}

static void test_stamps_of_old_kernels(void) {
    fake.no_stamps = 1;
    TEST_ASSERT_EQUAL_INT(0, open_source());
    TEST_ASSERT_EQUAL_INT(DRV_STAMP_US, stats().stamp);
    fake_item_t one = item(1, 0);
    one.old_stamp = 1;
    fake_put(one);
    one.sw_ns = one.old_stamp = 0;
    fake_put(one);
    TEST_ASSERT_EQUAL_INT(2, read_some());
    TEST_ASSERT_EQUAL_INT64(INT64_C(1700000000123456000), frames[0].time_ns);
    TEST_ASSERT_TRUE(frames[1].time_ns > INT64_C(1700000000000000000)); // our own clock
    source.ops->close(&source);
    fake.no_stamps = 2;
    TEST_ASSERT_EQUAL_INT(0, open_source());
    TEST_ASSERT_EQUAL_INT(DRV_STAMP_NONE, stats().stamp);
}

static void test_overflow_is_counted_once_and_placed(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_put(item(1, 0));
    fake_put(item(2, 7)); // 7 dropped before this one
    fake_put(item(3, 7));
    TEST_ASSERT_EQUAL_INT(3, read_some());
    TEST_ASSERT_EQUAL_INT(0, frames[0].loss);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_OVERFLOW, frames[1].loss);
    TEST_ASSERT_EQUAL_INT(0, frames[2].loss);
    TEST_ASSERT_EQUAL_UINT64(7, stats().lost_overflow);
    fake.meminfo_drops = 10; // three more behind the last frame
    TEST_ASSERT_EQUAL_UINT64(10, stats().lost_overflow);
    fake_put(item(4, 10));
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_OVERFLOW, frames[0].loss);
    fake_put(item(5, 9)); // an older count than the one just read
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_UINT64(10, stats().lost_overflow);
    fake.meminfo_drops = 12;
    source.ops->close(&source);
    TEST_ASSERT_EQUAL_UINT64(12, source.counts.lost_overflow);
}

static void test_the_drop_counter_wraps(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    for (uint32_t step = 1; step <= 6; ++step) {
        fake.meminfo_drops = step * 0x40000000u;
        fake_put(item(step, step * 0x40000000u));
        TEST_ASSERT_EQUAL_INT(1, read_some());
        TEST_ASSERT_EQUAL_UINT64(step * UINT64_C(0x40000000), stats().lost_overflow);
    }
}

static void test_errors_that_pass(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    static const int passing[] = {EINTR, EAGAIN, ENOBUFS, ENOMEM};
    for (int i = 0; i < 4; ++i) {
        fake_fail(passing[i]);
        TEST_ASSERT_EQUAL_INT(i < 2 ? 0 : -passing[i], read_some());
        fake_put(item(9, 0));
        TEST_ASSERT_EQUAL_INT(1, read_some());
        TEST_ASSERT_EQUAL_INT(0, frames[0].loss);
    }
    TEST_ASSERT_EQUAL_UINT64(2, stats().read_errors);
    TEST_ASSERT_EQUAL_INT(1, fake.can_sockets);
}

static void test_a_broken_socket_is_made_anew(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_fail(EIO);
    (void)read_some();
    fake_put(item(9, 0));
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_INT(2, fake.can_sockets);
    TEST_ASSERT_EQUAL_UINT64(1, stats().reopened);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK, frames[0].loss);
}

static void test_link_down_and_up(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    for (uint64_t round = 1; round <= 200; ++round) {
        fake_fail(ENETDOWN);
        fake.up = 0;
        fake_tell(RTM_NEWLINK);
        TEST_ASSERT_EQUAL_INT(0, read_some());
        TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
        TEST_ASSERT_FALSE(readable());
        fake.up = 1;
        fake_tell(RTM_NEWLINK);
        TEST_ASSERT_TRUE(readable());
        TEST_ASSERT_EQUAL_INT(0, read_some());
        TEST_ASSERT_EQUAL_INT(0, stats().link_is_down);
        fake_put(item(9, 0));
        TEST_ASSERT_EQUAL_INT(1, read_some());
        TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK, frames[0].loss);
        TEST_ASSERT_EQUAL_UINT64(round, stats().link_down);
    }
    TEST_ASSERT_EQUAL_INT(1, fake.can_sockets);
}

static void test_unplugged_and_back(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    for (uint64_t round = 1; round <= 200; ++round) {
        fake_fail(ENODEV);
        fake_tell(RTM_DELLINK);
        const int index = fake.index;
        fake.index = 0;
        TEST_ASSERT_EQUAL_INT(0, read_some());
        TEST_ASSERT_EQUAL_INT(0, read_some());
        TEST_ASSERT_FALSE(readable()); // no busy waiting for a device that is away
        TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
        fake.index = index + 1;
        fake_tell(RTM_NEWLINK);
        TEST_ASSERT_TRUE(readable()); // the news wake the reader
        TEST_ASSERT_EQUAL_INT(0, read_some());
        TEST_ASSERT_EQUAL_UINT64(round, stats().reopened);
        TEST_ASSERT_EQUAL_INT(0, stats().link_is_down);
        fake_put(item(9, 0));
        TEST_ASSERT_EQUAL_INT(1, read_some());
        TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK, frames[0].loss);
    }
    TEST_ASSERT_EQUAL_UINT64(200, stats().link_down);
}

/// For a name that is not there an ioctl starts modprobe, and the reader would wait for it while the interface comes back.
static void test_no_ioctl_asks_for_an_interface_that_is_away(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_fail(ENODEV);
    fake_tell(RTM_DELLINK);
    fake.index = 0;
    for (int i = 0; i < 100; ++i) TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_INT(0, fake.modprobes);
    fake.index = 6;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(1, stats().reopened);
}

/// The kernel tells that the link is down before it hands out the frames that had come: none is missing in front of them.
static void test_frames_that_wait_when_the_link_goes(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_fail(ENETDOWN);
    for (uint32_t id = 1; id <= 3; ++id) fake_put(item(id, 0));
    fake.up = 0;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
    TEST_ASSERT_EQUAL_INT(3, read_some());
    for (int i = 0; i < 3; ++i) TEST_ASSERT_EQUAL_INT(0, frames[i].loss);
    TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    fake.up = 1;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_INT(0, stats().link_is_down);
    fake_put(item(4, 0));
    fake_put(item(5, 0));
    TEST_ASSERT_EQUAL_INT(2, read_some());
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK, frames[0].loss);
    TEST_ASSERT_EQUAL_INT(0, frames[1].loss);
    TEST_ASSERT_EQUAL_UINT64(1, stats().link_down);
}

static void test_back_without_netlink(void) {
    fake.netlink_error = EPERM;
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_fail(ENXIO);
    fake.index = 0;
    TEST_ASSERT_EQUAL_INT(0, read_some());
    fake.index = 6;
    fake.up = 0; // there, but down as yet
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(1, stats().reopened);
    TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
    fake_put(item(9, 0));
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_INT(0, stats().link_is_down);
}

static void test_what_the_system_has_no_room_for(void) {
    fake.netlink_error = EPERM;
    fake.flags_error = EIO;
    TEST_ASSERT_EQUAL_INT(-EIO, open_source());
    fake.netlink_error = fake.flags_error = 0;
    fake.poll_set_error = EMFILE;
    TEST_ASSERT_EQUAL_INT(-EMFILE, open_source());
    TEST_ASSERT_EQUAL_STRING("interface can0: Too many open files", source.error);
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    fake.poll_set_error = 0;
    fake.poll_add_error = ENOSPC;
    TEST_ASSERT_EQUAL_INT(-ENOSPC, open_source());
    fake.poll_add_error = 0;
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake_fail(ENXIO);
    fake.index = 0;
    TEST_ASSERT_EQUAL_INT(0, read_some());
    fake.index = 6;
    fake.poll_add_error = ENOSPC; // it is back, but cannot be waited for: tried again with the next call
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(0, stats().reopened);
    fake.poll_add_error = 0;
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(1, stats().reopened);
}

static void test_another_device_takes_the_name(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake.index = 17;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(1, stats().reopened);
    fake.name = "can7"; // news of another interface change nothing
    fake.up = 0;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_INT(0, stats().link_is_down);
}

static void test_lost_news_are_looked_up(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    fake.up = 0;
    fake_tell_error(EINTR);
    fake_tell_error(ENOBUFS);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_INT(1, stats().link_is_down);
    fake.up = 1;
    fake.index = 0;
    fake_tell_error(ENOBUFS);
    TEST_ASSERT_EQUAL_INT(0, read_some()); // gone meanwhile: the socket will tell
    fake.index = 5;
}

static void test_error_messages_are_counted_not_delivered(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    send_error(CAN_ERR_BUSOFF, 0);
    send_error(CAN_ERR_RESTARTED, 0);
    send_error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW);
    fake_put(item(9, 0));
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, frames[0].loss);
    const drv_stats_t counts = stats();
    TEST_ASSERT_EQUAL_UINT64(3, counts.error_frames);
    TEST_ASSERT_EQUAL_UINT64(1, counts.bus_off);
    TEST_ASSERT_EQUAL_UINT64(1, counts.restarts);
    TEST_ASSERT_EQUAL_UINT64(1, counts.lost_driver);
    TEST_ASSERT_EQUAL_STRING("receive queue overran", counts.last_error);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_ACTIVE, counts.state);
}

/// The controller counts an overrun that it also sends an error message for: one loss, not two.
static void test_driver_losses_are_not_counted_twice(void) {
    fake.rx_dropped = 100; // before we came
    fake.rx_over_errors = 50;
    TEST_ASSERT_EQUAL_INT(0, open_source());
    TEST_ASSERT_EQUAL_UINT64(0, stats().lost_driver);
    send_error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(1, stats().lost_driver);
    fake.rx_over_errors = 52; // of one no message came
    fake.rx_dropped = 103;
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    TEST_ASSERT_EQUAL_UINT64(2 + 3, stats().lost_driver);
    fake_put(item(9, 0));
    TEST_ASSERT_EQUAL_INT(1, read_some());
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, frames[0].loss);
    fake.rx_over_errors = fake.rx_dropped = 0; // counters set back
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(0, read_some());
    fake.rx_dropped = 4;
    source.ops->close(&source);
    TEST_ASSERT_EQUAL_UINT64(2 + 3 + 4, source.counts.lost_driver);
}

static void test_batches_are_bounded(void) {
    TEST_ASSERT_EQUAL_INT(0, open_source());
    for (uint32_t i = 0; i < 200; ++i) fake_put(item(i, 0));
    uint32_t next = 0;
    for (int got; (got = source.ops->read(&source, frames, 50)) > 0;)
        for (int i = 0; i < got; ++i) TEST_ASSERT_EQUAL_UINT32(next++, frames[i].id);
    TEST_ASSERT_EQUAL_UINT32(200, next);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_refusals);
    RUN_TEST(test_configurations_that_cannot_be);
    RUN_TEST(test_options);
    RUN_TEST(test_frames_of_every_kind);
    RUN_TEST(test_stamps_of_old_kernels);
    RUN_TEST(test_overflow_is_counted_once_and_placed);
    RUN_TEST(test_the_drop_counter_wraps);
    RUN_TEST(test_errors_that_pass);
    RUN_TEST(test_a_broken_socket_is_made_anew);
    RUN_TEST(test_link_down_and_up);
    RUN_TEST(test_unplugged_and_back);
    RUN_TEST(test_no_ioctl_asks_for_an_interface_that_is_away);
    RUN_TEST(test_frames_that_wait_when_the_link_goes);
    RUN_TEST(test_back_without_netlink);
    RUN_TEST(test_what_the_system_has_no_room_for);
    RUN_TEST(test_another_device_takes_the_name);
    RUN_TEST(test_lost_news_are_looked_up);
    RUN_TEST(test_error_messages_are_counted_not_delivered);
    RUN_TEST(test_driver_losses_are_not_counted_twice);
    RUN_TEST(test_batches_are_bounded);
    return UNITY_END();
}
