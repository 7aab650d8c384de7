// SPDX-License-Identifier: MIT
#include <drv/candump.h>
#include <drv/source.h>

#include <string.h>
#include <unity.h>

static drv_frame_t frame;
static char name[DRV_NAME_BYTES];
static drv_candump_error_t error;

void setUp(void) { memset(&frame, 0xA5, sizeof frame); }
void tearDown(void) {}

static int parse(const char* line) { return drv_candump_parse(line, strlen(line), &frame, name, &error); }

static void test_classic(void) {
    TEST_ASSERT_EQUAL_INT(0, parse("(1700000000.123456) can0 123#0011ff"));
    TEST_ASSERT_EQUAL_INT64(INT64_C(1700000000123456000), frame.time_ns);
    TEST_ASSERT_EQUAL_STRING("can0", name);
    TEST_ASSERT_EQUAL_HEX32(0x123, frame.id);
    TEST_ASSERT_EQUAL_INT(0, frame.flags);
    TEST_ASSERT_EQUAL_INT(3, frame.len);
    TEST_ASSERT_EQUAL_HEX8(0xFF, frame.data[2]);
    TEST_ASSERT_EQUAL_INT(0, frame.loss | frame.bus);
}

static void test_other_kinds(void) {
    TEST_ASSERT_EQUAL_INT(0, parse("(0.0) vcan12 1ABCDEF0#R"));
    TEST_ASSERT_EQUAL_INT(DRV_FRAME_EXTENDED | DRV_FRAME_REMOTE, frame.flags);
    TEST_ASSERT_EQUAL_HEX32(0x1ABCDEF0, frame.id);
    TEST_ASSERT_EQUAL_INT(0, parse("(1.5) c 000001FF##3"));
    TEST_ASSERT_EQUAL_INT(DRV_FRAME_EXTENDED | DRV_FRAME_FD | DRV_FRAME_BRS | DRV_FRAME_ESI, frame.flags);
    TEST_ASSERT_EQUAL_INT(0, frame.len);
    TEST_ASSERT_EQUAL_INT(0, parse("(1.5) c 20000004#0004000000000000"));
    TEST_ASSERT_EQUAL_INT(DRV_FRAME_ERROR, frame.flags);
    TEST_ASSERT_EQUAL_HEX32(4, frame.id);
    TEST_ASSERT_EQUAL_INT(0, parse("(1.5) c 7FF#R8"));
    TEST_ASSERT_EQUAL_INT(8, frame.len);
}

static void test_tolerated(void) {
    TEST_ASSERT_EQUAL_INT(0, parse("(1.5)  can0\t001#11.22.33\r"));
    TEST_ASSERT_EQUAL_INT(3, frame.len);
    TEST_ASSERT_EQUAL_INT(0, parse("(1.123456789) can0 001#11 R"));
    TEST_ASSERT_EQUAL_INT64(1123456789, frame.time_ns);
    TEST_ASSERT_EQUAL_INT(0, parse("(1.5) can0 001#1122334455667788_9 T"));
}

static void refuse(const char* line, int column, const char* expected) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(-1, parse(line), line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(column, error.column, line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.expected, expected), error.expected);
}

static void test_refused(void) {
    refuse("", 1, "'('");
    TEST_ASSERT_EQUAL_STRING("end of line", error.found);
    refuse("1.5 can0 123#00", 1, "'('");
    refuse("(x) can0 123#00", 2, "digits");
    refuse("(1.5 can0 123#00", 5, "')'");
    refuse("(1.1234567890) can0 123#00", 13, "9 digits");
    refuse("(12345678901.0) can0 123#00", 12, "10 digits");
    refuse("(1.5)can0 123#00", 6, "blank");
    refuse("(1.5) ", 6, "blank");
    refuse("(1.5) abcdefghijklmnop 123#00", 22, "interface");
    refuse("(1.5) can0 12#00", 12, "3 or 8");
    refuse("(1.5) can0 FFF#00", 12, "11-bit");
    refuse("(1.5) can0 FFFFFFFF#00", 12, "29-bit");
    refuse("(1.5) can0 123:00", 15, "'#'");
    refuse("(1.5) can0 123#0", 17, "second");
    refuse("(1.5) can0 123#0G", 17, "second");
    refuse("(1.5) can0 123#001122334455667788", 32, "8 bytes");
    refuse("(1.5) can0 123##", 17, "FD flags");
    refuse("(1.5) can0 123##0001122334455667788", 36, "FD length");
    refuse("(1.5) can0 123#00 hello", 18, "end of the line");
}

static void test_round_trip(void) {
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    unsigned seed = 1;
    for (int i = 0; i < 4000; ++i) {
        drv_frame_t from;
        memset(&from, 0, sizeof from);
        seed = seed * 1103515245u + 12345u;
        from.time_ns = (INT64_C(1700000000) + i) * 1000000000 + (int64_t)(seed % 1000000) * 1000;
        if (i & 1) from.flags |= DRV_FRAME_EXTENDED;
        if (i & 2)
            from.flags |= (uint8_t)(DRV_FRAME_FD | (i & 4 ? DRV_FRAME_BRS : 0) | (i & 8 ? DRV_FRAME_ESI : 0));
        else if (i & 16)
            from.flags |= DRV_FRAME_REMOTE;
        from.id = seed >> 3 & (i & 1 ? 0x1FFFFFFF : 0x7FF);
        from.len = lengths[i % (i & 2 ? 16 : 9)];
        if (!(from.flags & DRV_FRAME_REMOTE))
            for (int k = 0; k < from.len; ++k) from.data[k] = (uint8_t)(seed >> (k % 24));
        char line[DRV_CANDUMP_BYTES];
        int count = drv_candump_format(line, sizeof line, "vcan0", &from);
        TEST_ASSERT_EQUAL_INT((int)strlen(line), count);
        memset(&frame, 0, sizeof frame);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse(line), line);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&from, &frame, sizeof frame, line);
    }
}

static void test_format_needs_room(void) {
    char line[DRV_CANDUMP_BYTES];
    memset(&frame, 0, sizeof frame);
    TEST_ASSERT_EQUAL_INT(-1, drv_candump_format(line, sizeof line - 1, "can0", &frame));
    TEST_ASSERT_EQUAL_INT(-1, drv_candump_format(line, sizeof line, "a-name-beyond-15", &frame));
    frame.len = 65;
    TEST_ASSERT_EQUAL_INT(-1, drv_candump_format(line, sizeof line, "can0", &frame));
}

/// Whatever is cut out of or put into a line: an answer, never a crash or a frame that is too long.
static void test_damaged_lines(void) {
    const char* line = "(1700000000.123456) can0 123##1001122334455667788990011 R";
    char damaged[64];
    unsigned seed = 7;
    for (int i = 0; i < 200000; ++i) {
        size_t length = strlen(line);
        memcpy(damaged, line, length);
        for (int k = 0; k < 1 + i % 4; ++k) {
            seed = seed * 1103515245u + 12345u;
            damaged[seed / 65536 % length] = (char)(seed >> 8);
        }
        if (drv_candump_parse(damaged, length - seed % 20, &frame, name, &error) == 0) {
            TEST_ASSERT_TRUE(frame.len <= 64);
            TEST_ASSERT_TRUE(strlen(name) < DRV_NAME_BYTES);
        }
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_classic);
    RUN_TEST(test_other_kinds);
    RUN_TEST(test_tolerated);
    RUN_TEST(test_refused);
    RUN_TEST(test_round_trip);
    RUN_TEST(test_format_needs_room);
    RUN_TEST(test_damaged_lines);
    return UNITY_END();
}
