// SPDX-License-Identifier: MIT
// Bits on the wire against a reference that writes every bit as a character and stuffs the text.
#include <drv/bus_load.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { TEXT = 2048 };

void setUp(void) {}
void tearDown(void) {}

static void write_bits(char* text, uint32_t value, int count) {
    size_t at = strlen(text);
    for (int i = count - 1; i >= 0; --i) text[at++] = (value >> i & 1) ? '1' : '0';
    text[at] = '\0';
}

/// Remainder of the message times x^15 by long division on characters.
static void append_crc15(char* text) {
    static const char divisor[] = "1100010110011001";
    char work[TEXT];
    size_t length = strlen(text);
    memcpy(work, text, length);
    memset(work + length, '0', 15);
    for (size_t i = 0; i < length; ++i)
        if (work[i] == '1')
            for (size_t k = 0; k < 16; ++k) work[i + k] = work[i + k] == divisor[k] ? '0' : '1';
    memcpy(text + length, work + length, 15);
    text[length + 15] = '\0';
}

/// Stuff bits among the first `count` characters, one behind the last of them included when `closing`.
static unsigned stuff_bits(const char* text, size_t count, int closing) {
    char wire[TEXT];
    size_t used = 0;
    unsigned stuffed = 0;
    for (size_t i = 0; i < count; ++i) {
        wire[used++] = text[i];
        int full = used >= 5;
        for (size_t k = 1; full && k < 5; ++k) full = wire[used - 1] == wire[used - 1 - k];
        if (!full || (i + 1 == count && !closing)) continue;
        wire[used] = wire[used - 1] == '1' ? '0' : '1';
        ++used;
        ++stuffed;
    }
    return stuffed;
}

static drv_wire_bits_t reference(const drv_frame_t* f) {
    static const unsigned lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    const int extended = (f->flags & DRV_FRAME_EXTENDED) != 0, fd = (f->flags & DRV_FRAME_FD) != 0;
    const int remote = (f->flags & DRV_FRAME_REMOTE) != 0, brs = (f->flags & DRV_FRAME_BRS) != 0;
    char text[TEXT] = "0";
    write_bits(text, extended ? f->id >> 18 : f->id, 11);
    if (extended) {
        strcat(text, "11");
        write_bits(text, f->id & 0x3FFFF, 18);
        strcat(text, remote ? "1" : "0");
    } else {
        strcat(text, remote ? "10" : "00");
    }
    if (fd)
        strcat(text, brs ? "101" : "100");
    else
        strcat(text, extended ? "00" : "0");
    const size_t slow_part = strlen(text);
    if (fd) strcat(text, f->flags & DRV_FRAME_ESI ? "1" : "0");
    unsigned code = 0;
    while (lengths[code] < f->len) ++code;
    write_bits(text, code, 4);
    for (unsigned i = 0; !remote && i < f->len; ++i) write_bits(text, f->data[i], 8);
    drv_wire_bits_t out = {0, 0};
    if (!fd) {
        append_crc15(text);
        out.slow = (uint32_t)(strlen(text) + stuff_bits(text, strlen(text), 1) + 13);
        return out;
    }
    const unsigned before = stuff_bits(text, slow_part, 0), all = stuff_bits(text, strlen(text), 0);
    const uint32_t slow = (uint32_t)slow_part + before + 13;
    const uint32_t fast = (uint32_t)(strlen(text) - slow_part) + all - before + (f->len > 16 ? 32 : 27);
    out.slow = slow + (brs ? 0 : fast);
    out.fast = brs ? fast : 0;
    return out;
}

static void check(const drv_frame_t* frame) {
    drv_wire_bits_t expected = reference(frame), found = drv_wire_bits(frame);
    char text[160];
    snprintf(text, sizeof text, "id %x flags %x len %u first byte %02x", (unsigned)frame->id, frame->flags, frame->len,
             frame->data[0]);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(expected.slow, found.slow, text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(expected.fast, found.fast, text);
}

static void test_random_frames_equal_the_reference(void) {
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    srand(7);
    for (int i = 0; i < 60000; ++i) {
        drv_frame_t frame;
        memset(&frame, 0, sizeof frame);
        const int fd = rand() % 2, extended = rand() % 2, fill = rand() % 4;
        frame.flags = (uint8_t)((extended ? DRV_FRAME_EXTENDED : 0) | (fd ? DRV_FRAME_FD : 0));
        if (fd)
            frame.flags = (uint8_t)(frame.flags | (rand() % 2 ? DRV_FRAME_BRS : 0) | (rand() % 8 ? 0 : DRV_FRAME_ESI));
        if (!fd && rand() % 8 == 0) frame.flags |= DRV_FRAME_REMOTE;
        frame.len = lengths[rand() % (fd ? 16 : 9)];
        frame.id = ((uint32_t)rand() ^ (uint32_t)rand() << 15) & (extended ? 0x1FFFFFFFu : 0x7FFu);
        if (fill == 1) frame.id = extended ? 0x1FFFFFFF : 0x7FF;
        if (fill == 2) frame.id = 0;
        for (unsigned k = 0; k < frame.len; ++k)
            frame.data[k] = (uint8_t)(fill == 0 ? rand() : fill == 1 ? 0xFF : fill == 2 ? 0 : rand() % 2 ? 0x0F : 0xF8);
        check(&frame);
    }
}

/// By hand: identifier 0 without data is 19 zeros, their CRC 15 more: 34 bits, a stuff bit behind every five, 13 fixed.
static void test_all_zeros(void) {
    drv_frame_t frame;
    memset(&frame, 0, sizeof frame);
    TEST_ASSERT_EQUAL_UINT32(34 + 6 + 13, drv_wire_bits(&frame).slow);
}

static void test_bounds_and_time(void) {
    drv_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.len = 8;
    drv_wire_bits_t bits = drv_wire_bits(&frame);
    TEST_ASSERT_TRUE(bits.slow >= 111 && bits.slow <= 135); // without and with every stuff bit
    TEST_ASSERT_EQUAL_DOUBLE(bits.slow / 5e5, drv_wire_seconds(&frame, 5e5, 0));
    frame.flags = DRV_FRAME_FD | DRV_FRAME_BRS;
    bits = drv_wire_bits(&frame);
    TEST_ASSERT_TRUE(bits.fast > 0);
    TEST_ASSERT_EQUAL_DOUBLE(bits.slow / 5e5 + bits.fast / 2e6, drv_wire_seconds(&frame, 5e5, 2e6));
    TEST_ASSERT_EQUAL_DOUBLE((bits.slow + bits.fast) / 5e5, drv_wire_seconds(&frame, 5e5, 0));
    frame.flags = DRV_FRAME_ERROR;
    TEST_ASSERT_EQUAL_DOUBLE(0.0, drv_wire_seconds(&frame, 5e5, 2e6));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_random_frames_equal_the_reference);
    RUN_TEST(test_all_zeros);
    RUN_TEST(test_bounds_and_time);
    return UNITY_END();
}
