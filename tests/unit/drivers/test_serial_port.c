// SPDX-License-Identifier: MIT
// A serial line whose kernel answers as it is told: refusals, baud rates, latency, counters of the hardware; and the slcan
// sink on it. The line itself is a pseudo terminal.
#include <drv/serial_port.h>
#include <drv/slcan.h>

#include <asm/termbits.h>

#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <unity.h>

enum { patience_ms = 1800000 }; // only ends what would never end

static struct {
    int open_error, get_error, set_error, write_error; ///< errno
    speed_t nearest;                                   ///< 0 = takes any baud rate
    int has_settings, settings_error, flags;           ///< TIOCGSERIAL, TIOCSSERIAL
    int has_counters;
    struct serial_icounter_struct counters;
    int waiting, asked; ///< bytes in the queue: one less each time TIOCOUTQ is asked
} kernel;
static int far = -1; // the other end of the line
static char device[64], knob[] = "/tmp/okid-latency-XXXXXX";
static drv_serial_t port = {.fd = -1};

// ---- the kernel --------------------------------------------------------------------------------------------------------

static int fault(int error) {
    errno = error;
    return -1;
}

int open(const char* path, int flags, ...) {
    if (kernel.open_error && strcmp(path, device) == 0) return fault(kernel.open_error);
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0600);
}

/// The latency timer of a USB adapter is a file of the test.
FILE* fopen(const char* restrict path, const char* restrict mode) {
    if (strncmp(path, "/sys/class/tty/", 15) == 0 && strstr(path, "/device/latency_timer")) path = knob;
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, path, strchr(mode, '+') ? O_RDWR : O_RDONLY, 0);
    return fd < 0 ? NULL : fdopen(fd, strchr(mode, '+') ? "r+" : "r");
}

ssize_t write(int fd, const void* bytes, size_t count) {
    if (kernel.write_error && fd == port.fd) return fault(kernel.write_error);
    return syscall(SYS_write, fd, bytes, count);
}

int ioctl(int fd, unsigned long request, ...) {
    va_list list;
    va_start(list, request);
    void* about = va_arg(list, void*);
    va_end(list);
    if (request == TCGETS2 && kernel.get_error) return fault(kernel.get_error);
    if (request == TCSETS2 && kernel.set_error) return fault(kernel.set_error);
    if (request == TIOCGSERIAL) return kernel.has_settings ? 0 : fault(ENOTTY);
    if (request == TIOCSSERIAL) {
        kernel.flags = ((struct serial_struct*)about)->flags;
        return kernel.settings_error ? fault(kernel.settings_error) : 0;
    }
    if (request == TIOCGICOUNT) {
        if (!kernel.has_counters) return fault(ENOTTY);
        *(struct serial_icounter_struct*)about = kernel.counters;
        return 0;
    }
    if (request == TIOCOUTQ && kernel.waiting > 0) {
        ++kernel.asked;
        *(int*)about = --kernel.waiting;
        return 0;
    }
    const int status = (int)syscall(SYS_ioctl, fd, request, about);
    if (status == 0 && request == TCGETS2 && kernel.nearest) ((struct termios2*)about)->c_ospeed = kernel.nearest;
    return status;
}

// ---- the tests ---------------------------------------------------------------------------------------------------------

static void tell_latency(const char* text) {
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, knob, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    TEST_ASSERT_TRUE(fd >= 0 && syscall(SYS_write, fd, text, strlen(text)) == (long)strlen(text));
    close(fd);
}

void setUp(void) {
    struct termios2 line;
    memset(&kernel, 0, sizeof kernel);
    far = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(far >= 0 && grantpt(far) == 0 && unlockpt(far) == 0);
    snprintf(device, sizeof device, "%s", ptsname(far));
    TEST_ASSERT_EQUAL_INT(0, ioctl(far, TCGETS2, &line)); // no echo before the line is set up
    line.c_lflag = line.c_oflag = 0;
    TEST_ASSERT_EQUAL_INT(0, ioctl(far, TCSETS2, &line));
    unlink(knob);
}

void tearDown(void) {
    memset(&kernel, 0, sizeof kernel);
    drv_serial_close(&port);
    if (far >= 0) close(far);
    far = -1;
    unlink(knob);
}

static void refused(int code, const char* path, const char* text) {
    char want[160];
    TEST_ASSERT_EQUAL_INT_MESSAGE(code, drv_serial_open(&port, path, 921600), port.error);
    snprintf(want, sizeof want, "%s: %s", path, text);
    TEST_ASSERT_EQUAL_STRING(want, port.error);
    TEST_ASSERT_EQUAL_INT(-1, port.fd);
}

static void start(void) { TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_serial_open(&port, device, 921600), port.error); }

static void test_what_cannot_be_opened(void) {
    static const int gone[] = {ENOENT, ENXIO, ENODEV, EIO}, forbidden[] = {EACCES, EPERM};
    for (int i = 0; i < 4; ++i) {
        kernel.open_error = gone[i];
        refused(-ENOENT, device, "there is no such device");
    }
    for (int i = 0; i < 2; ++i) {
        kernel.open_error = forbidden[i];
        refused(-EACCES, device, "no permission to open it");
    }
    kernel.open_error = EBUSY;
    refused(-EBUSY, device, "another program has it open");
    kernel.open_error = EMFILE;
    refused(-EMFILE, device, "Too many open files");
    kernel.open_error = 0;
    refused(-ENOTTY, "/dev/null", "is no serial device");
    kernel.get_error = ENOTTY;
    refused(-ENOTTY, device, "is no serial device");
    kernel.get_error = 0;
    kernel.set_error = EINVAL;
    refused(-EINVAL, device, "Invalid argument");
    kernel.set_error = 0;
    start();
    drv_serial_t second;
    TEST_ASSERT_EQUAL_INT(-EBUSY, drv_serial_open(&second, device, 921600));
    TEST_ASSERT_NOT_NULL(strstr(second.error, "another program has it open"));
    TEST_ASSERT_EQUAL_INT(-1, second.fd);
}

static void test_the_nearest_baud_rate_is_near_enough_or_said(void) {
    kernel.nearest = 115200;
    refused(-EINVAL, device, "cannot do 921600 baud, the nearest it can is 115200");
    kernel.nearest = 1000000; // 8.5 % above
    refused(-EINVAL, device, "cannot do 921600 baud, the nearest it can is 1000000");
    kernel.nearest = 923076; // 0.2 %
    start();
    TEST_ASSERT_EQUAL_INT(923076, port.baud);
}

static void test_latency_is_brought_down_and_told(void) {
    start();
    TEST_ASSERT_EQUAL_INT(-1, port.latency_ms); // no such knob: no USB adapter
    TEST_ASSERT_EQUAL_INT(0, port.low_latency);
    drv_serial_close(&port);
    tell_latency("16\n");
    kernel.has_settings = 1;
    start();
    TEST_ASSERT_EQUAL_INT(1, port.low_latency);
    TEST_ASSERT_TRUE(kernel.flags & (int)ASYNC_LOW_LATENCY);
    char text[8] = "";
    const int fd = open(knob, O_RDONLY);
    TEST_ASSERT_TRUE(read(fd, text, sizeof text - 1) > 0);
    close(fd);
    TEST_ASSERT_EQUAL_INT('1', text[0]); // what was asked for; the kernel makes the number whole
    TEST_ASSERT_TRUE(port.latency_ms >= 1);
    drv_serial_close(&port);
    tell_latency("?");
    kernel.settings_error = EPERM;
    start();
    TEST_ASSERT_EQUAL_INT(0, port.low_latency);
    drv_serial_close(&port);
}

static void test_what_the_hardware_counts(void) {
    drv_serial_errors_t errors;
    kernel.has_counters = 1;
    kernel.counters = (struct serial_icounter_struct){.overrun = 10, .buf_overrun = 20, .frame = 30, .parity = 40};
    start();
    TEST_ASSERT_EQUAL_INT(1, port.counts_errors);
    drv_serial_errors(&port, &errors);
    TEST_ASSERT_EQUAL_UINT32(0, errors.overrun + errors.frame + errors.parity); // what was before is not ours
    kernel.counters = (struct serial_icounter_struct){.overrun = 11, .buf_overrun = 22, .frame = 34, .parity = 48};
    drv_serial_errors(&port, &errors);
    TEST_ASSERT_EQUAL_UINT32(3, errors.overrun);
    TEST_ASSERT_EQUAL_UINT32(4, errors.frame);
    TEST_ASSERT_EQUAL_UINT32(8, errors.parity);
    kernel.has_counters = 0; // unplugged meanwhile
    drv_serial_errors(&port, &errors);
    TEST_ASSERT_EQUAL_UINT32(0, errors.overrun + errors.frame + errors.parity);
}

static void test_overruns_of_the_hardware_mark_the_next_frame(void) {
    drv_source_t source = {.ops = &drv_source_slcan};
    drv_source_config_t config = {0};
    drv_frame_t frame;
    drv_stats_t stats;
    config.line.device = device;
    config.line.baud = 921600;
    kernel.has_counters = 1;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, source.ops->open(&source, &config), source.error);
    kernel.counters.overrun = 2;
    kernel.counters.frame = 5;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(2, stats.lost_driver);
    TEST_ASSERT_EQUAL_UINT64(2, stats.line_overruns);
    TEST_ASSERT_EQUAL_UINT64(5, stats.line_errors);
    TEST_ASSERT_EQUAL_INT(6, write(far, "t0010\r", 6));
    int got = 0;
    while (got == 0) {
        struct pollfd wait = {source.ops->fd(&source), POLLIN, 0};
        TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, patience_ms));
        got = source.ops->read(&source, &frame, 1);
    }
    TEST_ASSERT_EQUAL_INT(1, got);
    TEST_ASSERT_EQUAL_HEX8(DRV_LOSS_DRIVER, frame.loss);
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(2, stats.lost_driver); // counted once
    source.ops->close(&source);
}

static void test_a_line_that_takes_nothing(void) {
    static uint8_t bytes[1 << 20];
    start();
    TEST_ASSERT_EQUAL_INT(-ETIMEDOUT, drv_serial_write(&port, bytes, sizeof bytes, 5)); // nobody reads the other end
    TEST_ASSERT_NOT_NULL(strstr(port.error, "takes no more bytes"));
    kernel.write_error = EIO;
    TEST_ASSERT_EQUAL_INT(-EIO, drv_serial_write(&port, bytes, 1, 5));
    TEST_ASSERT_EQUAL_STRING("cannot be written: Input/output error", port.error);
}

static void test_close_waits_for_the_queue(void) {
    start();
    kernel.waiting = 4;
    drv_serial_close(&port);
    TEST_ASSERT_EQUAL_INT(4, kernel.asked); // 3, 2, 1 and 0 bytes
    TEST_ASSERT_EQUAL_INT(-1, port.fd);
    drv_serial_close(&port);
    TEST_ASSERT_EQUAL_INT(4, kernel.asked);
}

/// What stands on the other end, until `count` characters are there.
static void expect_heard(const char* want) {
    char text[256];
    size_t got = 0, count = strlen(want);
    while (got < count) {
        struct pollfd wait = {far, POLLIN, 0};
        TEST_ASSERT_EQUAL_INT(1, poll(&wait, 1, patience_ms));
        const ssize_t more = read(far, text + got, sizeof text - 1 - got);
        got += more > 0 ? (size_t)more : 0;
    }
    text[got] = '\0';
    TEST_ASSERT_EQUAL_STRING(want, text);
}

static void test_frames_go_out_by_slcan(void) {
    drv_slcan_sink_t sink;
    drv_line_config_t config = {0};
    drv_frame_t frame = {0};
    config.device = device;
    config.baud = 921600;
    config.bitrate = 500000;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_slcan_sink_open(&sink, &config), sink.error);
    expect_heard("\rC\rS6\rO\r");
    TEST_ASSERT_EQUAL_INT(3, write(far, "\r\rz", 3)); // answers: fetched, or they fill the queue
    frame.id = 0x123;
    frame.len = 2;
    frame.data[0] = 0xAB;
    TEST_ASSERT_EQUAL_INT(0, drv_slcan_sink_write(&sink, &frame, 100));
    expect_heard("t1232AB00\r");
    frame.flags = DRV_FRAME_ERROR;
    TEST_ASSERT_EQUAL_INT(0, drv_slcan_sink_write(&sink, &frame, 100)); // nothing to send
    TEST_ASSERT_EQUAL_UINT64(1, sink.sent);
    int left = -1;
    TEST_ASSERT_EQUAL_INT(0, ioctl(sink.port.fd, TIOCINQ, &left));
    TEST_ASSERT_EQUAL_INT(0, left);
    drv_slcan_sink_close(&sink);
    expect_heard("C\r");
    TEST_ASSERT_EQUAL_INT(-1, sink.port.fd);
    drv_slcan_sink_close(&sink);
}

static void test_slcan_sinks_that_are_refused(void) {
    drv_slcan_sink_t sink;
    drv_line_config_t config = {0};
    drv_frame_t frame = {0};
    config.device = device;
    config.baud = 921600;
    config.bitrate = 333333;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_slcan_sink_open(&sink, &config));
    TEST_ASSERT_NOT_NULL(strstr(sink.error, "slcan has no command for bitrate 333333"));
    TEST_ASSERT_EQUAL_INT(-1, sink.port.fd);
    config.bitrate = 0;
    kernel.open_error = EACCES;
    TEST_ASSERT_EQUAL_INT(-EACCES, drv_slcan_sink_open(&sink, &config));
    TEST_ASSERT_NOT_NULL(strstr(sink.error, "no permission to open it"));
    kernel.open_error = 0;
    TEST_ASSERT_EQUAL_INT(0, drv_slcan_sink_open(&sink, &config));
    int status = 0;
    for (int i = 0; i < 200000 && status == 0; ++i) status = drv_slcan_sink_write(&sink, &frame, 1);
    TEST_ASSERT_EQUAL_INT(-ETIMEDOUT, status); // nobody reads the other end
    TEST_ASSERT_NOT_NULL(strstr(sink.error, "takes no more bytes"));
    TEST_ASSERT_TRUE(sink.sent > 100);
    close(far);
    far = -1; // or close() waits for what can never go out
    drv_slcan_sink_close(&sink);
}

static void refused_by_slcan(drv_line_config_t line, int code, const char* text) {
    drv_source_t source = {.ops = &drv_source_slcan};
    drv_source_config_t config = {0};
    config.line = line;
    TEST_ASSERT_EQUAL_INT(code, source.ops->open(&source, &config));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(source.error, text), source.error);
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    TEST_ASSERT_EQUAL_INT(-EBADF, source.ops->read(&source, NULL, 0));
    source.ops->close(&source);
}

static void test_slcan_sources_that_are_refused(void) {
    char far_too_long[DRV_PATH_BYTES + 1];
    memset(far_too_long, 'x', sizeof far_too_long - 1);
    far_too_long[sizeof far_too_long - 1] = '\0';
    drv_line_config_t line = {0};
    line.device = device;
    line.baud = 921600;
    line.bitrate = 12345;
    refused_by_slcan(line, -EINVAL, "slcan has no command for bitrate 12345");
    line.bitrate = 500000;
    line.device = far_too_long;
    refused_by_slcan(line, -EINVAL, "a device has a path of 1 to 255 characters");
    line.device = "";
    refused_by_slcan(line, -EINVAL, "a device has a path of 1 to 255 characters");
}

int main(void) {
    const int room = mkstemp(knob);
    if (room < 0) return 1;
    close(room);
    UNITY_BEGIN();
    RUN_TEST(test_what_cannot_be_opened);
    RUN_TEST(test_the_nearest_baud_rate_is_near_enough_or_said);
    RUN_TEST(test_latency_is_brought_down_and_told);
    RUN_TEST(test_what_the_hardware_counts);
    RUN_TEST(test_overruns_of_the_hardware_mark_the_next_frame);
    RUN_TEST(test_a_line_that_takes_nothing);
    RUN_TEST(test_close_waits_for_the_queue);
    RUN_TEST(test_frames_go_out_by_slcan);
    RUN_TEST(test_slcan_sinks_that_are_refused);
    RUN_TEST(test_slcan_sources_that_are_refused);
    return UNITY_END();
}
