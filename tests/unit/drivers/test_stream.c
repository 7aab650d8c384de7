// SPDX-License-Identifier: MIT
// The node's packets through the host's decoder: every format, every kind of damage.
#include <drv/crc.h>
#include <drv/decoder.h>
#include <drv/stream.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static drv_decoder_t decoder;
static uint8_t wire[DRV_STREAM_ENCODED];

void setUp(void) { drv_decoder_init(&decoder, DRV_FRAMING_COBS, 0); }
void tearDown(void) {}

static void feed(const uint8_t* bytes, size_t count) {
    uint8_t* at = NULL;
    TEST_ASSERT_TRUE(drv_decoder_room(&decoder, &at) >= count);
    memcpy(at, bytes, count);
    drv_decoder_add(&decoder, count);
}

static size_t packet_of(uint32_t sequence, unsigned channels, unsigned samples, drv_stream_format_t format) {
    const drv_stream_header_t header = {format, (uint8_t)channels, (uint8_t)samples, sequence, sequence * 1000};
    int32_t codes[504];
    float values[504];
    for (unsigned i = 0; i < channels * samples; ++i) {
        codes[i] = (int32_t)(sequence + i) * (i % 2 ? -37 : 41);
        values[i] = (float)codes[i] / 7;
    }
    return format == DRV_STREAM_FLOAT32 ? drv_stream_encode_floats(&header, values, wire, sizeof wire)
                                        : drv_stream_encode_codes(&header, codes, wire, sizeof wire);
}

static void test_check_values(void) {
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, drv_crc32(0, (const uint8_t*)"123456789", 9));
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, drv_crc32(drv_crc32(0, (const uint8_t*)"1234", 4), (const uint8_t*)"56789", 5));
    TEST_ASSERT_EQUAL_HEX16(0x31C3, drv_crc16_ccitt(0, (const uint8_t*)"123456789", 9));
}

static void test_every_format_arrives(void) {
    for (unsigned format = 0; format < 3; ++format)
        for (unsigned channels = 1; channels <= 20; ++channels)
            for (unsigned samples = 1; samples <= 12; ++samples) {
                const size_t length = packet_of(1000 + samples, channels, samples, (drv_stream_format_t)format);
                TEST_ASSERT_TRUE(length > 0 && wire[length - 1] == 0);
                TEST_ASSERT_NULL(memchr(wire, 0, length - 1));
                feed(wire, length);
                TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
                TEST_ASSERT_EQUAL_UINT32(1000 + samples, decoder.packet.sequence);
                TEST_ASSERT_EQUAL_UINT64((1000 + samples) * UINT64_C(1000000), decoder.packet.time_ns);
                TEST_ASSERT_EQUAL_INT(channels, decoder.packet.fields);
                TEST_ASSERT_EQUAL_INT(samples, decoder.packet.samples);
                for (unsigned i = 0; i < channels * samples; ++i) {
                    const int32_t code = (int32_t)(1000 + samples + i) * (i % 2 ? -37 : 41);
                    const double want = format == 2   ? (double)((float)code / 7)
                                        : format == 1 ? code
                                                      : (double)(int16_t)code;
                    TEST_ASSERT_TRUE(decoder.packet.values[i] == want);
                }
                TEST_ASSERT_EQUAL_INT(0, drv_decoder_next(&decoder));
            }
    TEST_ASSERT_EQUAL_UINT64(0, decoder.damaged + decoder.skipped);
}

static void test_what_does_not_fit_is_refused(void) {
    drv_stream_header_t header = {DRV_STREAM_INT16, 4, 126, 0, 0}; // 1008 bytes of samples: the most
    int32_t codes[512] = {0};
    for (int i = 0; i < 504; ++i) codes[i] = 0x0101; // no zeros: the longest packet
    TEST_ASSERT_EQUAL_INT(DRV_STREAM_ENCODED, drv_stream_bytes(&header));
    TEST_ASSERT_TRUE(drv_stream_encode_codes(&header, codes, wire, sizeof wire) > DRV_STREAM_MAX_BYTES + 4);
    TEST_ASSERT_EQUAL_INT(0, drv_stream_encode_codes(&header, codes, wire, sizeof wire - 1));
    TEST_ASSERT_EQUAL_INT(0, drv_stream_encode_floats(&header, (const float*)codes, wire, sizeof wire));
    header.samples = 127;
    TEST_ASSERT_EQUAL_INT(0, drv_stream_bytes(&header));
    header.samples = 0;
    TEST_ASSERT_EQUAL_INT(0, drv_stream_bytes(&header));
    header.samples = 1;
    header.format = (drv_stream_format_t)3;
    TEST_ASSERT_EQUAL_INT(0, drv_stream_bytes(&header));
}

/// One bit wrong, one byte gone, one byte more: the packet is refused, the next one says so and is whole.
static void test_every_damage_is_seen(void) {
    uint8_t good[256], bad[256];
    const size_t length = packet_of(7, 3, 2, DRV_STREAM_INT16);
    memcpy(good, wire, length);
    feed(good, length);
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    for (size_t i = 0; i + 1 < length; ++i)
        for (unsigned kind = 0; kind < 10; ++kind) {
            size_t count = length;
            memcpy(bad, good, length);
            if (kind < 8) {
                bad[i] ^= (uint8_t)(1 << kind);
            } else if (kind == 8) {
                memmove(bad + i, bad + i + 1, --count - i);
            } else {
                memmove(bad + i + 1, bad + i, count++ - i);
                bad[i] = (uint8_t)(i + 1);
            }
            const uint64_t before = decoder.damaged;
            feed(bad, count);
            feed(good, length);
            TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
            TEST_ASSERT_EQUAL_UINT32(7, decoder.packet.sequence);
            TEST_ASSERT_EQUAL_INT(0, drv_decoder_next(&decoder));
            TEST_ASSERT_TRUE(decoder.damaged > before);
        }
}

static void test_joining_in_the_middle_counts_nothing(void) {
    const size_t length = packet_of(9, 2, 1, DRV_STREAM_INT24);
    feed(wire + 5, length - 5);
    feed(wire, length);
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT64(0, decoder.damaged + decoder.skipped);
}

static void test_a_stream_without_an_end_is_skipped(void) {
    const size_t length = packet_of(3, 1, 1, DRV_STREAM_INT16);
    uint8_t packet[64], noise[1500];
    memcpy(packet, wire, length);
    memset(noise, 0x11, sizeof noise);
    feed(packet, length);
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    feed(noise, sizeof noise);
    feed((const uint8_t*)"", 1);
    feed(packet, length);
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT64(DRV_STREAM_ENCODED, decoder.skipped);
    TEST_ASSERT_EQUAL_UINT64(1, decoder.damaged);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_check_values);
    RUN_TEST(test_every_format_arrives);
    RUN_TEST(test_what_does_not_fit_is_refused);
    RUN_TEST(test_every_damage_is_seen);
    RUN_TEST(test_joining_in_the_middle_counts_nothing);
    RUN_TEST(test_a_stream_without_an_end_is_skipped);
    return UNITY_END();
}
