// SPDX-License-Identifier: MIT
// Every length at every offset in both byte orders, against a codec that moves one bit at a time.
#include <drv/codec.h>

#include <math.h>
#include <string.h>
#include <unity.h>

void setUp(void) {}
void tearDown(void) {}

static uint64_t state = 88172645463325252u;
static uint64_t next_random(void) {
    state ^= state << 13;
    state ^= state >> 7;
    return state ^= state << 17;
}

/// Number of bit k (0 = least significant) of the signal in DBC counting, -1 outside of 64 bytes.
static int bit_number(const drv_signal_t* s, unsigned k) {
    if (!s->big_endian) return s->start_bit + (int)k;
    int at = s->start_bit;
    for (unsigned step = 0; step + k + 1 < s->length; ++step) at = at % 8 == 0 ? at + 15 : at - 1;
    return at;
}

static int fits(const drv_signal_t* s) {
    for (unsigned k = 0; k < s->length; ++k)
        if (bit_number(s, k) > 511) return 0;
    return 1;
}

static uint64_t slow_raw(const drv_signal_t* s, const uint8_t* data) {
    uint64_t value = 0;
    for (unsigned k = 0; k < s->length; ++k) {
        int bit = bit_number(s, k);
        value |= (uint64_t)(data[bit / 8] >> (bit % 8) & 1) << k;
    }
    return value;
}

static void check_layout(unsigned start, unsigned length, int big_endian, int is_signed) {
    drv_signal_t s = {.start_bit = (uint16_t)start,
                      .length = (uint16_t)length,
                      .big_endian = (uint8_t)big_endian,
                      .is_signed = (uint8_t)is_signed,
                      .scale = 1};
    if (!fits(&s)) {
        TEST_ASSERT_NOT_NULL(drv_signal_prepare(&s));
        return;
    }
    TEST_ASSERT_NULL(drv_signal_prepare(&s));
    uint8_t data[64], before[64];
    for (int i = 0; i < 64; ++i) data[i] = (uint8_t)next_random();
    size_t need = drv_signal_bytes(&s);
    int64_t raw = 0;
    TEST_ASSERT_EQUAL_INT(0, drv_signal_raw(&s, data, need - 1, &raw));
    TEST_ASSERT_EQUAL_INT(1, drv_signal_raw(&s, data, need, &raw));
    uint64_t mask = length == 64 ? UINT64_MAX : ((uint64_t)1 << length) - 1;
    TEST_ASSERT_EQUAL_HEX64(slow_raw(&s, data), (uint64_t)raw & mask);
    if (!is_signed || !((uint64_t)raw >> (length - 1) & 1))
        TEST_ASSERT_EQUAL_HEX64((uint64_t)raw & mask, (uint64_t)raw);
    else
        TEST_ASSERT_TRUE(raw < 0);
    memcpy(before, data, sizeof data);
    uint64_t fresh = next_random() & mask;
    TEST_ASSERT_EQUAL_INT(1, drv_signal_put(&s, data, 64, (int64_t)fresh));
    TEST_ASSERT_EQUAL_HEX64(fresh, slow_raw(&s, data));
    drv_signal_put(&s, data, 64, (int64_t)slow_raw(&s, before));
    TEST_ASSERT_EQUAL_MEMORY(before, data, sizeof data); // neighbours were left alone
}

static void test_every_layout(void) {
    for (unsigned length = 1; length <= 64; ++length)
        for (unsigned start = 0; start < 512; start += start < 80 || start > 430 ? 1 : 7)
            for (int kind = 0; kind < 4; ++kind) check_layout(start, length, kind & 1, kind >> 1);
}

static void test_known_values(void) {
    // GSV-4 habit: big-endian, offset binary; 0x8000 is zero.
    drv_signal_t s = {.start_bit = 7, .length = 16, .big_endian = 1, .scale = 0.5, .offset = -16384};
    TEST_ASSERT_NULL(drv_signal_prepare(&s));
    uint8_t data[64] = {0x80, 0x02, 0xFE, 0xFF};
    double value = 0;
    TEST_ASSERT_EQUAL_INT(1, drv_signal_decode(&s, data, 8, &value));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, value);
    drv_signal_t t = {.start_bit = 16, .length = 16, .is_signed = 1, .scale = 1};
    TEST_ASSERT_NULL(drv_signal_prepare(&t));
    TEST_ASSERT_EQUAL_INT(1, drv_signal_decode(&t, data, 4, &value));
    TEST_ASSERT_EQUAL_DOUBLE(-2.0, value);
}

static void test_floats(void) {
    for (int big = 0; big < 2; ++big) {
        drv_signal_t f = {.start_bit = (uint16_t)(big ? 7 : 0),
                          .length = 32,
                          .big_endian = (uint8_t)big,
                          .value = DRV_VALUE_FLOAT32,
                          .scale = 2,
                          .offset = 1};
        drv_signal_t d = {.start_bit = (uint16_t)(big ? 71 : 64),
                          .length = 64,
                          .big_endian = (uint8_t)big,
                          .value = DRV_VALUE_FLOAT64,
                          .scale = 1};
        TEST_ASSERT_NULL(drv_signal_prepare(&f));
        TEST_ASSERT_NULL(drv_signal_prepare(&d));
        uint8_t data[64] = {0};
        double value = 0;
        TEST_ASSERT_EQUAL_INT(1, drv_signal_encode(&f, data, 16, -2.5));
        TEST_ASSERT_EQUAL_INT(1, drv_signal_encode(&d, data, 16, 1.0 / 3));
        TEST_ASSERT_EQUAL_INT(1, drv_signal_decode(&f, data, 16, &value));
        TEST_ASSERT_EQUAL_DOUBLE(-2.5, value);
        TEST_ASSERT_EQUAL_INT(1, drv_signal_decode(&d, data, 16, &value));
        TEST_ASSERT_EQUAL_DOUBLE(1.0 / 3, value);
    }
}

static void test_encode_saturates(void) {
    drv_signal_t s = {.length = 8, .is_signed = 1, .scale = 0.1};
    drv_signal_t u = {.start_bit = 8, .length = 64, .scale = 1};
    TEST_ASSERT_NULL(drv_signal_prepare(&s));
    TEST_ASSERT_NULL(drv_signal_prepare(&u));
    uint8_t data[64] = {0};
    TEST_ASSERT_EQUAL_INT(2, drv_signal_encode(&s, data, 16, 12.85));
    TEST_ASSERT_EQUAL_HEX8(0x7F, data[0]);
    TEST_ASSERT_EQUAL_INT(2, drv_signal_encode(&s, data, 16, -1e300));
    TEST_ASSERT_EQUAL_HEX8(0x80, data[0]);
    TEST_ASSERT_EQUAL_INT(1, drv_signal_encode(&s, data, 16, -0.31));
    TEST_ASSERT_EQUAL_HEX8(0xFD, data[0]);
    TEST_ASSERT_EQUAL_INT(0, drv_signal_encode(&s, data, 16, NAN));
    TEST_ASSERT_EQUAL_INT(2, drv_signal_encode(&u, data, 16, 1e30));
    TEST_ASSERT_EQUAL_HEX8(0xFF, data[8]);
    TEST_ASSERT_EQUAL_INT(2, drv_signal_encode(&u, data, 16, -1));
    TEST_ASSERT_EQUAL_HEX8(0, data[8]);
    TEST_ASSERT_EQUAL_INT(0, drv_signal_encode(&u, data, 8, 1)); // frame too short
}

static void test_impossible_layouts(void) {
    drv_signal_t none = {.length = 0}, wide = {.length = 65}, far = {.start_bit = 512, .length = 1};
    drv_signal_t half = {.length = 16, .value = DRV_VALUE_FLOAT32}, most = {.length = 32, .value = DRV_VALUE_FLOAT64};
    TEST_ASSERT_NOT_NULL(drv_signal_prepare(&none));
    TEST_ASSERT_NOT_NULL(drv_signal_prepare(&wide));
    TEST_ASSERT_NOT_NULL(drv_signal_prepare(&far));
    TEST_ASSERT_NOT_NULL(drv_signal_prepare(&half));
    TEST_ASSERT_NOT_NULL(drv_signal_prepare(&most));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_layout);
    RUN_TEST(test_known_values);
    RUN_TEST(test_floats);
    RUN_TEST(test_encode_saturates);
    RUN_TEST(test_impossible_layouts);
    return UNITY_END();
}
