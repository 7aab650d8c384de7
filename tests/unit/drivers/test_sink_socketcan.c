// SPDX-License-Identifier: MIT
// The CAN sink against a kernel of our own making: what goes out, a queue that is full, every interface it cannot use.
#include <drv/sink.h>

#include <errno.h>

#include <linux/can.h>
#include <net/if.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <unity.h>

enum { ANSWERS = 8 };

static struct {
    int socket_error, index, bind_error, up;
    int answers[ANSWERS], first, last; ///< errno of the next writes, then they go through
    int filters;                       ///< bytes of CAN_RAW_FILTER, -1 = never set
} kernel;
static int ends[2] = {-1, -1}; // the socket, and what hears it
static drv_sink_t sink;

static int fault(int error) {
    errno = error;
    return -1;
}

int socket(int domain, int type, int protocol) {
    (void)domain, (void)type, (void)protocol;
    if (kernel.socket_error) return fault(kernel.socket_error);
    return socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends) == 0 ? ends[0] : -1;
}

int bind(int fd, const struct sockaddr* address, socklen_t length) {
    (void)fd, (void)address, (void)length;
    return kernel.bind_error ? fault(kernel.bind_error) : 0;
}

int setsockopt(int fd, int level, int name, const void* value, socklen_t length) {
    (void)fd, (void)level, (void)value;
    if (name == 1) kernel.filters = (int)length; // CAN_RAW_FILTER
    return 0;
}

int ioctl(int fd, unsigned long request, ...) {
    (void)fd;
    va_list list;
    va_start(list, request);
    struct ifreq* about = va_arg(list, struct ifreq*);
    va_end(list);
    about->ifr_flags = kernel.up ? IFF_UP : 0;
    return strcmp(about->ifr_name, "can0") == 0 ? 0 : fault(ENODEV);
}

unsigned if_nametoindex(const char* name) { return strcmp(name, "can0") == 0 ? (unsigned)kernel.index : 0; }

ssize_t write(int fd, const void* bytes, size_t count) {
    if (fd == ends[0] && kernel.first < kernel.last) return fault(kernel.answers[kernel.first++]);
    return syscall(SYS_write, fd, bytes, count);
}

static void answer(int error) { kernel.answers[kernel.last++] = error; }

void setUp(void) {
    memset(&kernel, 0, sizeof kernel);
    kernel.index = 3;
    kernel.up = 1;
    kernel.filters = -1;
}

void tearDown(void) {
    drv_sink_close(&sink);
    if (ends[1] >= 0) close(ends[1]);
    ends[0] = ends[1] = -1;
}

static void refused(int code, const char* interface, const char* text) {
    TEST_ASSERT_EQUAL_INT(code, drv_sink_open(&sink, interface));
    TEST_ASSERT_EQUAL_STRING(text, sink.error);
    TEST_ASSERT_EQUAL_INT(-1, sink.fd);
    if (ends[1] >= 0) {
        char byte;
        TEST_ASSERT_EQUAL_INT(0, read(ends[1], &byte, 1)); // the socket was closed
        close(ends[1]);
        ends[1] = -1;
    }
}

static void test_what_cannot_be_opened(void) {
    kernel.socket_error = EAFNOSUPPORT;
    refused(-EAFNOSUPPORT, "can0", "interface can0: this kernel has no CAN (no AF_CAN or no can-raw)");
    kernel.socket_error = EPROTONOSUPPORT;
    refused(-EAFNOSUPPORT, "can0", "interface can0: this kernel has no CAN (no AF_CAN or no can-raw)");
    kernel.socket_error = EPERM;
    refused(-EPERM, "can0", "interface can0: Operation not permitted");
    kernel.socket_error = 0;
    refused(-EINVAL, "a-name-of-16-let", "interface a-name-of-16-let: an interface name has at most 15 characters");
    refused(-ENODEV, "can1", "interface can1: there is no such interface");
    kernel.bind_error = ENODEV;
    refused(-ENODEV, "can0", "interface can0: is not a CAN interface");
    kernel.bind_error = EIO;
    refused(-EIO, "can0", "interface can0: Input/output error");
    kernel.bind_error = 0;
    kernel.up = 0;
    refused(-ENETDOWN, "can0", "interface can0: is down");
}

static void start(void) { TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_sink_open(&sink, "can0"), sink.error); }

/// The next frame on the bus. @return its bytes, -1 = none
static ssize_t heard(struct canfd_frame* out) {
    memset(out, 0, sizeof *out);
    return read(ends[1], out, sizeof *out);
}

static void test_frames_go_out_as_they_are(void) {
    struct canfd_frame raw;
    drv_frame_t frame = {0};
    start();
    TEST_ASSERT_EQUAL_INT(0, kernel.filters); // it hears nothing itself
    frame.id = 0x123;
    frame.len = 3;
    memcpy(frame.data, "\1\2\3", 3);
    TEST_ASSERT_EQUAL_INT(0, drv_sink_write(&sink, &frame, 0));
    TEST_ASSERT_EQUAL_INT(CAN_MTU, heard(&raw));
    TEST_ASSERT_EQUAL_HEX32(0x123, raw.can_id);
    TEST_ASSERT_EQUAL_INT(3, raw.len);
    TEST_ASSERT_EQUAL_MEMORY("\1\2\3\0\0\0\0\0", raw.data, 8);

    frame.id = 0x18F00123;
    frame.flags = DRV_FRAME_EXTENDED | DRV_FRAME_REMOTE;
    TEST_ASSERT_EQUAL_INT(0, drv_sink_write(&sink, &frame, 0));
    TEST_ASSERT_EQUAL_INT(CAN_MTU, heard(&raw));
    TEST_ASSERT_EQUAL_HEX32(0x18F00123 | CAN_EFF_FLAG | CAN_RTR_FLAG, raw.can_id);
    TEST_ASSERT_EQUAL_MEMORY("\0\0\0", raw.data, 3); // a request carries no data

    frame.id = 7;
    frame.flags = DRV_FRAME_FD | DRV_FRAME_BRS | DRV_FRAME_ESI;
    frame.len = 64;
    memset(frame.data, 0x5A, 64);
    TEST_ASSERT_EQUAL_INT(0, drv_sink_write(&sink, &frame, 0));
    TEST_ASSERT_EQUAL_INT(CANFD_MTU, heard(&raw));
    TEST_ASSERT_EQUAL_HEX8(CANFD_BRS | CANFD_ESI, raw.flags);
    TEST_ASSERT_EQUAL_INT(64, raw.len);
    TEST_ASSERT_EQUAL_HEX8(0x5A, raw.data[63]);

    frame.flags = DRV_FRAME_ERROR;
    TEST_ASSERT_EQUAL_INT(0, drv_sink_write(&sink, &frame, 0));
    TEST_ASSERT_EQUAL_INT(-1, heard(&raw)); // what a controller reported is not said again
    TEST_ASSERT_EQUAL_UINT64(3, sink.sent);
}

static void test_a_full_queue_is_waited_for(void) {
    struct canfd_frame raw;
    drv_frame_t frame = {0};
    start();
    answer(ENOBUFS), answer(EINTR), answer(EAGAIN), answer(ENOBUFS);
    TEST_ASSERT_EQUAL_INT(0, drv_sink_write(&sink, &frame, 10));
    TEST_ASSERT_EQUAL_UINT64(3, sink.waits);
    TEST_ASSERT_EQUAL_UINT64(1, sink.sent);
    TEST_ASSERT_EQUAL_INT(CAN_MTU, heard(&raw));
    answer(ENOBUFS), answer(ENOBUFS);
    TEST_ASSERT_EQUAL_INT(-ENOBUFS, drv_sink_write(&sink, &frame, 1)); // its patience is one millisecond
    TEST_ASSERT_EQUAL_STRING("frame 2 cannot be sent: No buffer space available", sink.error);
    TEST_ASSERT_EQUAL_UINT64(4, sink.waits);
    TEST_ASSERT_EQUAL_INT(-1, heard(&raw));
}

static void test_what_the_interface_refuses_is_said(void) {
    drv_frame_t frame = {0};
    start();
    answer(EINVAL);
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_sink_write(&sink, &frame, 100));
    TEST_ASSERT_EQUAL_STRING("frame 1 cannot be sent: Invalid argument", sink.error);
    frame.flags = DRV_FRAME_FD;
    answer(EINVAL);
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_sink_write(&sink, &frame, 100));
    TEST_ASSERT_NOT_NULL(strstr(sink.error, "(an FD frame on an interface with mtu 16?)"));
    answer(ENETDOWN);
    TEST_ASSERT_EQUAL_INT(-ENETDOWN, drv_sink_write(&sink, &frame, 100));
    TEST_ASSERT_EQUAL_UINT64(0, sink.sent);
    TEST_ASSERT_EQUAL_UINT64(0, sink.waits);
    drv_sink_close(&sink);
    drv_sink_close(&sink);
    TEST_ASSERT_EQUAL_INT(-1, sink.fd);
}

int main(void) {
    sink.fd = -1;
    UNITY_BEGIN();
    RUN_TEST(test_what_cannot_be_opened);
    RUN_TEST(test_frames_go_out_as_they_are);
    RUN_TEST(test_a_full_queue_is_waited_for);
    RUN_TEST(test_what_the_interface_refuses_is_said);
    return UNITY_END();
}
