// SPDX-License-Identifier: MIT
#include <drv/source.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static char path[] = "/tmp/okid-replay-XXXXXX";
static drv_source_t source = {.ops = &drv_source_replay};
static drv_frame_t frames[64];

void setUp(void) {
    strcpy(path + strlen(path) - 6, "XXXXXX");
    int fd = mkstemp(path);
    TEST_ASSERT_TRUE(fd >= 0);
    close(fd);
}

void tearDown(void) {
    source.ops->close(&source);
    unlink(path);
}

static int start(const char* text, size_t length, const char* first, const char* second) {
    FILE* file = fopen(path, "w");
    fwrite(text, 1, length, file);
    fclose(file);
    drv_source_config_t config = {
        .path = path, .interfaces = {first, second}, .interface_count = first ? second ? 2 : 1 : 0};
    return source.ops->open(&source, &config);
}

static void test_two_interfaces_are_told_apart(void) {
    const char* text = "(1.0) can0 001#\n(1.1) can1 002#\n\n(1.2) other 003#\r\n(1.3) can1 20000004#00\n(1.4) can0 "
                       "001#R\n(1.5) can1 004#AA";
    TEST_ASSERT_EQUAL_INT(0, start(text, strlen(text), "can0", "can1"));
    TEST_ASSERT_EQUAL_INT(3, source.ops->read(&source, frames, 64));
    TEST_ASSERT_EQUAL_INT(0, frames[0].bus);
    TEST_ASSERT_EQUAL_INT(1, frames[1].bus);
    TEST_ASSERT_EQUAL_HEX32(4, frames[2].id);
    TEST_ASSERT_EQUAL_INT(DRV_END, source.ops->read(&source, frames, 64));
    drv_stats_t stats;
    source.ops->stats(&source, &stats);
    TEST_ASSERT_EQUAL_UINT64(3, stats.received);
    TEST_ASSERT_EQUAL_UINT64(1, stats.foreign);
    TEST_ASSERT_EQUAL_UINT64(1, stats.error_frames);
    TEST_ASSERT_EQUAL_UINT64(1, stats.remote);
}

static void test_a_bad_line_names_itself_after_the_good_ones(void) {
    const char* text = "(1.0) can0 001#\n(1.1) can0 0X1#00\n(1.2) can0 001#\n";
    TEST_ASSERT_EQUAL_INT(0, start(text, strlen(text), NULL, NULL));
    TEST_ASSERT_EQUAL_INT(1, source.ops->read(&source, frames, 64));
    TEST_ASSERT_EQUAL_INT(-EBADMSG, source.ops->read(&source, frames, 64));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "line 2, column 12: found \"0X1#00\", expected an identifier"));
}

static void test_what_cannot_be_read(void) {
    TEST_ASSERT_EQUAL_INT(-1, source.ops->fd(&source));
    drv_source_config_t config = {.path = "/tmp"};
    TEST_ASSERT_EQUAL_INT(-EISDIR, source.ops->open(&source, &config));
    TEST_ASSERT_EQUAL_STRING("/tmp: cannot be read: Is a directory", source.error);
    config.path = "/proc/self/mem"; // opens, but nothing is mapped at its beginning
    TEST_ASSERT_EQUAL_INT(0, source.ops->open(&source, &config));
    TEST_ASSERT_TRUE(source.ops->fd(&source) >= 0);
    TEST_ASSERT_EQUAL_INT(-EIO, source.ops->read(&source, frames, 64));
    TEST_ASSERT_EQUAL_STRING("/proc/self/mem: cannot be read: Input/output error", source.error);
}

static void test_a_file_without_lines(void) {
    size_t length = 1 << 20;
    char* text = malloc(length);
    memset(text, 'x', length);
    TEST_ASSERT_EQUAL_INT(0, start(text, length, NULL, NULL));
    free(text);
    TEST_ASSERT_EQUAL_INT(-EBADMSG, source.ops->read(&source, frames, 64));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "line 1"));
}

/// Lines that straddle the read buffer, in reads of every size.
static void test_many_lines(void) {
    enum { LINES = 30000 };
    char* text = malloc((size_t)LINES * 64);
    size_t length = 0;
    for (int i = 0; i < LINES; ++i)
        length += (size_t)sprintf(text + length, "(%d.000001) can0 %08X#%.*s\n", i, i, 2 * (i % 9), "0011223344556677");
    TEST_ASSERT_EQUAL_INT(0, start(text, length, NULL, NULL));
    free(text);
    int next = 0, count;
    while ((count = source.ops->read(&source, frames, 1 + next % 64)) > 0)
        for (int i = 0; i < count; ++i, ++next) {
            TEST_ASSERT_EQUAL_UINT32(next, frames[i].id);
            TEST_ASSERT_EQUAL_INT(next % 9, frames[i].len);
        }
    TEST_ASSERT_EQUAL_INT(DRV_END, count);
    TEST_ASSERT_EQUAL_INT(LINES, next);
}

static void test_what_cannot_be_opened(void) {
    drv_source_config_t config = {.path = "/nonexistent/log"};
    TEST_ASSERT_EQUAL_INT(-ENOENT, source.ops->open(&source, &config));
    TEST_ASSERT_NOT_NULL(strstr(source.error, "/nonexistent/log"));
    config.path = "/tmp";
    TEST_ASSERT_EQUAL_INT(-EISDIR, source.ops->open(&source, &config));
    TEST_ASSERT_EQUAL_INT(-EBADF, source.ops->read(&source, frames, 64));
}

/// Without CAN in the kernel or without the interface: a reason, no crash.
static void test_socketcan_gives_a_reason(void) {
    drv_source_t can = {.ops = &drv_source_socketcan};
    drv_source_config_t config = {.interfaces = {"okid-none"}, .interface_count = 1};
    int code = can.ops->open(&can, &config);
    TEST_ASSERT_TRUE(code == -EAFNOSUPPORT || code == -ENODEV || code == -EPERM);
    TEST_ASSERT_NOT_NULL(strstr(can.error, "okid-none"));
    TEST_ASSERT_EQUAL_INT(-1, can.ops->fd(&can));
    TEST_ASSERT_EQUAL_INT(-EBADF, can.ops->read(&can, frames, 64));
    can.ops->close(&can);
    config.interfaces[0] = "a-name-of-16-cha";
    TEST_ASSERT_EQUAL_INT(-EINVAL, can.ops->open(&can, &config));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_two_interfaces_are_told_apart);
    RUN_TEST(test_a_bad_line_names_itself_after_the_good_ones);
    RUN_TEST(test_what_cannot_be_read);
    RUN_TEST(test_a_file_without_lines);
    RUN_TEST(test_many_lines);
    RUN_TEST(test_what_cannot_be_opened);
    RUN_TEST(test_socketcan_gives_a_reason);
    return UNITY_END();
}
