// SPDX-License-Identifier: MIT
// Serial sources on a pseudo terminal: samples in, frames out; unplugged and plugged in again.
#include <drv/host_clock.h>
#include <drv/line_frame.h>
#include <drv/serial_port.h>
#include <drv/slcan.h>
#include <drv/stream.h>

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>
#include <unity.h>

static char folder[] = "/tmp/okid-serial-XXXXXX", device[64];
static int far = -1; // the other end of the line
static drv_source_t source;
static drv_frame_t frames[256];

static void plug_in(void) {
    struct termios line;
    far = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(far >= 0 && grantpt(far) == 0 && unlockpt(far) == 0);
    TEST_ASSERT_EQUAL_INT(0, tcgetattr(far, &line));
    cfmakeraw(&line);
    TEST_ASSERT_EQUAL_INT(0, tcsetattr(far, TCSANOW, &line));
    unlink(device);
    TEST_ASSERT_EQUAL_INT(0, symlink(ptsname(far), device));
}

static void unplug(void) {
    close(far);
    far = -1;
    unlink(device);
}

void setUp(void) {
    strcpy(folder + strlen(folder) - 6, "XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    snprintf(device, sizeof device, "%s/sensor", folder);
    plug_in();
}

void tearDown(void) {
    source.ops->close(&source);
    if (far >= 0) unplug();
    rmdir(folder);
}

static drv_source_config_t settings(drv_framing_t framing) {
    drv_source_config_t config = {0};
    config.line.device = device;
    config.line.baud = 921600;
    config.line.framing = framing;
    config.line.rate_hz = 1000;
    return config;
}

static void start(const drv_source_ops_t* ops, const drv_source_config_t* config) {
    source.ops = ops;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, ops->open(&source, config), source.error);
}

static void say(const void* bytes, size_t count) { TEST_ASSERT_EQUAL_INT(count, write(far, bytes, count)); }

enum { patience_ms = 1800000 }; // only ends what would never end

static void say_samples(uint32_t sequence, unsigned channels, unsigned samples, uint32_t time_us) {
    const drv_stream_header_t header = {DRV_STREAM_INT16, (uint8_t)channels, (uint8_t)samples, sequence, time_us};
    uint8_t wire[DRV_STREAM_ENCODED];
    int32_t codes[504];
    for (unsigned i = 0; i < channels * samples; ++i) codes[i] = (int32_t)(sequence * 10 + i);
    say(wire, drv_stream_encode_codes(&header, codes, wire, sizeof wire));
}

/// Wait until `count` frames have come.
static void expect_frames(int count) {
    int got = 0;
    while (got < count) {
        const int more = source.ops->read(&source, frames + got, 256 - got);
        TEST_ASSERT_TRUE(more >= 0);
        got += more;
        struct pollfd wait = {source.ops->fd(&source), POLLIN, 0};
        if (more == 0) TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, patience_ms));
    }
    TEST_ASSERT_EQUAL_INT(count, got);
}

static double field(int frame, unsigned which) {
    drv_signal_t signal;
    double value = -1e9;
    TEST_ASSERT_EQUAL_UINT32(frames[frame].id, drv_line_frame_field(DRV_FRAMING_COBS, which, &signal));
    TEST_ASSERT_TRUE(drv_signal_decode(&signal, frames[frame].data, frames[frame].len, &value));
    return value;
}

static int64_t counter(int frame) {
    drv_signal_t signal;
    int64_t value = -1;
    drv_line_frame_counter(32, &signal);
    TEST_ASSERT_TRUE(drv_signal_raw(&signal, frames[frame].data, frames[frame].len, &value));
    return value;
}

static void test_packets_become_frames(void) {
    const drv_source_config_t config = settings(DRV_FRAMING_COBS);
    start(&drv_source_serial, &config);
    const int64_t before = drv_host_time_ns();
    say_samples(100, 9, 4, 0xFFFFFF00);
    expect_frames(8);
    const int64_t after = drv_host_time_ns();
    for (int i = 0; i < 8; ++i) {
        TEST_ASSERT_EQUAL_INT(i % 2, frames[i].id);
        TEST_ASSERT_EQUAL_INT64(100 + i / 2, counter(i));
        TEST_ASSERT_EQUAL_INT64(i / 2 * 1000000, frames[i].time_ns - frames[0].time_ns);
        TEST_ASSERT_EQUAL_INT64(INT64_C(0xFFFFFF00) * 1000 + i / 2 * 1000000, frames[i].hw_time_ns);
        for (unsigned k = 0; k < (i % 2 ? 2 : 7); ++k)
            TEST_ASSERT_TRUE(field(i, (unsigned)i % 2 * 7 + k) == 1000 + i / 2 * 9 + i % 2 * 7 + (int)k);
    }
    TEST_ASSERT_TRUE(frames[7].time_ns >= before - INT64_C(100000000) && frames[7].time_ns <= after);
    say_samples(104, 9, 1, 0x00000EA0); // the device's clock has wrapped
    expect_frames(2);
    TEST_ASSERT_EQUAL_INT64((INT64_C(0x100000000) + 0xEA0) * 1000, frames[0].hw_time_ns);
}

static void test_damage_marks_the_next_frame(void) {
    const drv_source_config_t config = settings(DRV_FRAMING_COBS);
    start(&drv_source_serial, &config);
    say_samples(1, 1, 1, 0);
    say("\x05\x11\x22\x33\x44\0", 6);
    say_samples(3, 1, 1, 2000);
    expect_frames(2);
    TEST_ASSERT_EQUAL_HEX8(0, frames[0].loss);
    TEST_ASSERT_EQUAL_HEX8(DRV_LOSS_CRC, frames[1].loss);
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(1, stats.damaged);
    TEST_ASSERT_EQUAL_UINT64(2, stats.received);
}

static void test_unplugged_and_back(void) {
    const drv_source_config_t config = settings(DRV_FRAMING_COBS);
    start(&drv_source_serial, &config);
    for (int round = 0; round < 5; ++round) {
        drv_stats_t stats;
        say_samples(1, 1, 1, 0);
        say("\x03\x01", 2); // a packet that is never finished
        expect_frames(1);
        TEST_ASSERT_EQUAL_HEX8(round ? DRV_LOSS_LINK : 0, frames[0].loss);
        unplug();
        while (source.ops->fd(&source) >= 0) TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
        TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
        source.ops->stats(&source, &stats);
        TEST_ASSERT_TRUE(stats.link_is_down);
        TEST_ASSERT_EQUAL_UINT64(round + 1, stats.link_down);
        plug_in();
        while (source.ops->fd(&source) < 0) TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
        source.ops->stats(&source, &stats);
        TEST_ASSERT_EQUAL_UINT64(round + 1, stats.reopened);
        TEST_ASSERT_EQUAL_UINT64(0, stats.damaged);
    }
}

/// The frames of pushed bytes, at once.
static int pushed(const void* bytes, size_t count, int64_t arrived_ns) {
    int got = 0;
    drv_line_push(&source, bytes, count, arrived_ns);
    for (int more; (more = source.ops->read(&source, frames + got, 256 - got)) > 0;) got += more;
    return got;
}

static void test_bytes_that_are_pushed(void) {
    static uint8_t wire[60 * 64];
    drv_source_config_t config = settings(DRV_FRAMING_COBS);
    config.line.device = NULL;
    start(&drv_source_serial, &config);
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    size_t count = 0;
    for (uint32_t k = 0; k < 60; ++k) {
        const drv_stream_header_t header = {DRV_STREAM_INT24, 12, 1, k, k * 1000};
        int32_t codes[12] = {(int32_t)k};
        count += drv_stream_encode_codes(&header, codes, wire + count, sizeof wire - count);
    }
    TEST_ASSERT_EQUAL_INT(120, pushed(wire, count, INT64_C(5000000000))); // more than one read of the decoder
    TEST_ASSERT_EQUAL_INT64(INT64_C(5000000000), frames[119].time_ns);
    TEST_ASSERT_TRUE(frames[0].time_ns < frames[2].time_ns && frames[117].time_ns < frames[119].time_ns);
    TEST_ASSERT_EQUAL_INT(0, pushed(wire, count / 60 / 2, INT64_C(6000000000)));
    drv_line_break(&source);
    TEST_ASSERT_EQUAL_INT(2, pushed(wire, count / 60, INT64_C(7000000000)));
    TEST_ASSERT_EQUAL_HEX8(DRV_LOSS_LINK, frames[0].loss);
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(1, stats.link_down);
    TEST_ASSERT_EQUAL_INT(0, stats.link_is_down);
    source.ops->close(&source);
    start(&drv_source_serial, &config);
    TEST_ASSERT_EQUAL_INT(120, pushed(wire, count, 0)); // nobody knows when: by the node's clock
    TEST_ASSERT_EQUAL_INT64(INT64_C(1059000000), frames[119].time_ns);
    source.ops->close(&source);
    config.line.framing = DRV_FRAMING_ASCII;
    start(&drv_source_serial, &config);
    TEST_ASSERT_EQUAL_INT(3, pushed("0,0\n1,2\n3,4\n5,6\n", 16, 0)); // .. or one period apart
    TEST_ASSERT_EQUAL_INT64(INT64_C(1000000000), frames[0].time_ns);
    TEST_ASSERT_EQUAL_INT64(INT64_C(1002000000), frames[2].time_ns);
    source.ops->close(&source);
    start(&drv_source_slcan, &config);
    TEST_ASSERT_EQUAL_INT(2, pushed("\rt1231AA\rt0010\rt12", 18, 42));
    TEST_ASSERT_EQUAL_INT64(42, frames[1].time_ns);
}

static void test_what_cannot_be_opened(void) {
    drv_serial_t port;
    char plain[80];
    TEST_ASSERT_EQUAL_INT(-ENOENT, drv_serial_open(&port, "/dev/serial/by-id/none", 9600));
    TEST_ASSERT_NOT_NULL(strstr(port.error, "there is no such device"));
    snprintf(plain, sizeof plain, "%s/plain", folder);
    close(open(plain, O_CREAT | O_WRONLY, 0600));
    TEST_ASSERT_EQUAL_INT(-ENOTTY, drv_serial_open(&port, plain, 9600));
    unlink(plain);
    drv_source_config_t config = settings(DRV_FRAMING_ASCII);
    source.ops = &drv_source_serial;
    config.line.rate_hz = 0;
    TEST_ASSERT_EQUAL_INT(-EINVAL, source.ops->open(&source, &config));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "needs a framing and a sample rate above 0"));
    config = settings(DRV_FRAMINGS);
    TEST_ASSERT_EQUAL_INT(-EINVAL, source.ops->open(&source, &config));
    config = settings(DRV_FRAMING_ASCII);
    config.line.device = "/dev/serial/by-id/none";
    TEST_ASSERT_EQUAL_INT(-ENOENT, source.ops->open(&source, &config));
    TEST_ASSERT_EQUAL_STRING("/dev/serial/by-id/none: there is no such device", source.error);
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    config = settings(DRV_FRAMING_ASCII);
    start(&drv_source_serial, &config);
    TEST_ASSERT_EQUAL_INT(-EBUSY, drv_serial_open(&port, device, 9600)); // ours alone
    TEST_ASSERT_NOT_NULL(strstr(port.error, "another program"));
}

static void test_the_line_is_raw_and_any_baud_is_taken(void) {
    static const int32_t bauds[] = {50, 9600, 250000, 460800, 921600, 1234567, 3000000};
    drv_serial_t port;
    uint8_t every[256], back[256];
    source.ops = &drv_source_serial;
    for (unsigned i = 0; i < sizeof bauds / sizeof bauds[0]; ++i) {
        TEST_ASSERT_EQUAL_INT(0, drv_serial_open(&port, device, bauds[i]));
        TEST_ASSERT_EQUAL_INT32(bauds[i], port.baud);
        int exclusive = 0;
        TEST_ASSERT_TRUE(ioctl(port.fd, TIOCGEXCL, &exclusive) != 0 || exclusive == 1);
        drv_serial_close(&port);
    }
    TEST_ASSERT_EQUAL_INT(0, drv_serial_open(&port, device, 9600));
    for (int i = 0; i < 256; ++i) every[i] = (uint8_t)i;
    say(every, 256);
    size_t got = 0;
    while (got < 256) {
        struct pollfd wait = {port.fd, POLLIN, 0};
        TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, patience_ms));
        got += (size_t)drv_serial_read(&port, back + got, sizeof back - got);
    }
    TEST_ASSERT_EQUAL_MEMORY(every, back, 256);
    TEST_ASSERT_EQUAL_INT(0, drv_serial_write(&port, every, 256, 1000));
    TEST_ASSERT_EQUAL_INT(256, read(far, back, sizeof back));
    TEST_ASSERT_EQUAL_MEMORY(every, back, 256);
    static uint8_t plenty[1 << 17];
    TEST_ASSERT_EQUAL_INT(-ETIMEDOUT, drv_serial_write(&port, plenty, sizeof plenty, 50)); // nobody reads
    drv_serial_errors_t errors;
    drv_serial_errors(&port, &errors);
    TEST_ASSERT_EQUAL_UINT32(0, errors.overrun + errors.frame + errors.parity);
    drv_serial_close(&port);
}

static void expect_said(const char* want) {
    char text[256];
    size_t got = 0;
    while (got < strlen(want)) {
        struct pollfd wait = {far, POLLIN, 0};
        TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, patience_ms));
        got += (size_t)read(far, text + got, sizeof text - 1 - got);
    }
    text[got] = '\0';
    TEST_ASSERT_EQUAL_STRING(want, text);
}

static void test_slcan_adapter(void) {
    drv_source_config_t config = settings(DRV_FRAMING_COBS);
    config.line.bitrate = 500000;
    config.line.dbitrate = 2000000;
    start(&drv_source_slcan, &config);
    expect_said("\rC\rS6\rY2\rO\r");
    const char* text = "\a\r\rt12";
    say(text, strlen(text)); // bell: closing a closed channel. A line in pieces
    TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
    text = "32AABB\rz\rT18F02D0B8010203040506070812AB\rr1230\rt999\rt1002zz00\rd1239000102030405060708090A0B\r\a";
    say(text, strlen(text));
    expect_frames(3);
    TEST_ASSERT_EQUAL_HEX32(0x123, frames[0].id);
    TEST_ASSERT_EQUAL_INT(2, frames[0].len);
    TEST_ASSERT_EQUAL_HEX8(0xBB, frames[0].data[1]);
    TEST_ASSERT_EQUAL_HEX32(0x18F02D0B, frames[1].id);
    TEST_ASSERT_EQUAL_HEX8(DRV_FRAME_EXTENDED, frames[1].flags);
    TEST_ASSERT_EQUAL_INT64(((int64_t)0x12AB + 1) * 1000000, frames[1].hw_time_ns);
    TEST_ASSERT_EQUAL_HEX8(DRV_FRAME_FD, frames[2].flags);
    TEST_ASSERT_EQUAL_INT(12, frames[2].len);
    TEST_ASSERT_EQUAL_HEX8(DRV_LOSS_CRC, frames[2].loss);
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(3, stats.received);
    TEST_ASSERT_EQUAL_UINT64(2, stats.damaged);
    TEST_ASSERT_EQUAL_UINT64(2, stats.refused);
    TEST_ASSERT_EQUAL_UINT64(1, stats.remote);
    say("t001064F0\r", 10); // the stamp goes round: 0x12AB = 4779 ms, then 25840, then 100 of the next minute
    say("t00100064\r", 10);
    expect_frames(2);
    TEST_ASSERT_EQUAL_INT64(INT64_C(25841) * 1000000, frames[0].hw_time_ns);
    TEST_ASSERT_EQUAL_INT64(INT64_C(60101) * 1000000, frames[1].hw_time_ns);
    unplug();
    while (source.ops->fd(&source) >= 0) source.ops->read(&source, frames, 256);
    plug_in();
    while (source.ops->fd(&source) < 0) source.ops->read(&source, frames, 256);
    expect_said("\rC\rS6\rY2\rO\r"); // an adapter that was off must be told again
    say("t0010\r", 6);
    expect_frames(1);
    TEST_ASSERT_EQUAL_HEX8(DRV_LOSS_LINK, frames[0].loss);
    source.ops->close(&source);
    expect_said("C\r");
}

static void test_slcan_a_torn_first_line_is_no_frame(void) {
    const drv_source_config_t config = settings(DRV_FRAMING_COBS);
    start(&drv_source_slcan, &config);
    say("d12301\rt00111\a", 14); // "d…" may be the end of a line of data
    expect_frames(0);
    for (int i = 0; i < 100; ++i) TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
    char endless[5000];
    memset(endless, 'A', sizeof endless);
    say("\r", 1);
    for (int i = 0; i < 10; ++i) {
        say(endless, 500);
        TEST_ASSERT_EQUAL_INT(0, source.ops->read(&source, frames, 256));
    }
    say("t0010\rt0021AA\r", 14); // the first belongs to the endless line
    expect_frames(1);
    TEST_ASSERT_EQUAL_HEX32(2, frames[0].id);
}

static void test_slcan_lines_there_and_back(void) {
    uint32_t random = 7;
    for (int round = 0; round < 20000; ++round) {
        drv_frame_t frame = {0}, back = {0};
        random = random * 1664525U + 1013904223U;
        const unsigned fd = random >> 31, extended = random >> 30 & 1, fast = random >> 29 & 1;
        static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
        frame.len = lengths[(random >> 20) % (fd ? 16 : 9)];
        frame.id = random & (extended ? 0x1FFFFFFF : 0x7FF);
        frame.flags = (uint8_t)((extended ? DRV_FRAME_EXTENDED : 0) | (fd ? DRV_FRAME_FD : 0) |
                                (fd && fast ? DRV_FRAME_BRS : 0) | (!fd && fast ? DRV_FRAME_REMOTE : 0));
        for (int i = 0; i < frame.len && !(frame.flags & DRV_FRAME_REMOTE); ++i)
            frame.data[i] = (uint8_t)(random >> i % 24);
        char line[DRV_SLCAN_BYTES + 1];
        int stamp = 0;
        const int length = drv_slcan_format(line, sizeof line, &frame);
        TEST_ASSERT_TRUE(length > 0 && line[length - 1] == '\r');
        TEST_ASSERT_EQUAL_INT(1, drv_slcan_parse(line, (size_t)length - 1, &back, &stamp));
        TEST_ASSERT_EQUAL_INT(-1, stamp);
        TEST_ASSERT_EQUAL_MEMORY(&frame, &back, sizeof frame);
        TEST_ASSERT_EQUAL_INT(-1, drv_slcan_parse(line, (size_t)length - 2, &back, &stamp));
    }
    char text[64];
    TEST_ASSERT_EQUAL_INT(-1, drv_slcan_opening(text, sizeof text, 33333, 0, NULL));
    TEST_ASSERT_EQUAL_INT(-1, drv_slcan_opening(text, sizeof text, 500000, 3000000, NULL));
    TEST_ASSERT_EQUAL_INT(11, drv_slcan_opening(text, sizeof text, 33333, 0, "031C"));
    TEST_ASSERT_EQUAL_STRING("\rC\rs031C\rO\r", text);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_packets_become_frames);
    RUN_TEST(test_damage_marks_the_next_frame);
    RUN_TEST(test_unplugged_and_back);
    RUN_TEST(test_bytes_that_are_pushed);
    RUN_TEST(test_what_cannot_be_opened);
    RUN_TEST(test_the_line_is_raw_and_any_baud_is_taken);
    RUN_TEST(test_slcan_adapter);
    RUN_TEST(test_slcan_a_torn_first_line_is_no_frame);
    RUN_TEST(test_slcan_lines_there_and_back);
    return UNITY_END();
}
