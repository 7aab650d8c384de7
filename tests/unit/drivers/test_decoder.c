// SPDX-License-Identifier: MIT
// Recorded bytes of text lines, WitMotion and VectorNav devices (made by us after the makers' descriptions) and the
// samples they must give.
#include <drv/crc.h>
#include <drv/decoder.h>

#include <math.h>
#include <string.h>
#include <unity.h>

static drv_decoder_t decoder;

void setUp(void) {}
void tearDown(void) {}

static void feed(const void* bytes, size_t count) {
    uint8_t* at = NULL;
    TEST_ASSERT_TRUE(drv_decoder_room(&decoder, &at) >= count);
    memcpy(at, bytes, count);
    drv_decoder_add(&decoder, count);
}

static void feed_text(const char* text) { feed(text, strlen(text)); }

static void begin(drv_framing_t framing, int32_t counter) { drv_decoder_init(&decoder, framing, counter); }

static void expect_line(const char* line, unsigned count, double a, double b) {
    begin(DRV_FRAMING_ASCII, 0);
    feed_text("torn\n");
    feed_text(line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, drv_decoder_next(&decoder), line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(count, decoder.packet.fields, line);
    const double* v = decoder.packet.values;
    TEST_ASSERT_TRUE_MESSAGE(v[0] == a || (isnan(v[0]) && isnan(a)), line);
    TEST_ASSERT_TRUE_MESSAGE(count < 2 || v[1] == b || (isnan(v[1]) && isnan(b)), line);
}

static void test_lines_of_every_habit(void) {
    expect_line("1.5,-2e3\n", 2, 1.5, -2000);
    expect_line("1.5, -2e3\r\n", 2, 1.5, -2000);
    expect_line("  1.5 \t -2e3  \r\n", 2, 1.5, -2000);
    expect_line("1.5;-2e3;\n", 2, 1.5, -2000);
    expect_line("ax:1.5,ay:-2e3\n", 2, 1.5, -2000);
    expect_line("ax: 1.5 ay: -2e3\n", 2, 1.5, -2000);
    expect_line("ax=1.5 ay= -2e3\n", 2, 1.5, -2000);
    expect_line("+7\n", 1, 7, 0);
    expect_line(",1\n", 2, NAN, 1);
    expect_line("1,nan\n", 2, 1, NAN);
    expect_line("1,,3\n", 3, 1, NAN);
}

static void refuse_line(const char* line) {
    begin(DRV_FRAMING_ASCII, 0);
    feed_text("torn\n1,2\n");
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    feed_text(line);
    feed_text("5,6\n");
    TEST_ASSERT_EQUAL_INT_MESSAGE(2, drv_decoder_next(&decoder), line);
    TEST_ASSERT_TRUE_MESSAGE(decoder.packet.values[0] == 5, line);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(1, decoder.damaged, line);
}

static void test_lines_that_are_none(void) {
    refuse_line("hello\n");
    refuse_line("1,2x\n");
    refuse_line("1,0x10\n");
    refuse_line("1,2,3\n");
    refuse_line("1\n");
    refuse_line("1.2.3,4\n");
    refuse_line("1,--2\n");
    refuse_line("ax:,2\n");
    refuse_line("1,ay:\n");
    refuse_line("nan,nan\n");
    refuse_line("1,2\x01\n");
    refuse_line("1,0000000000000000000000000000000000000000000002\n");
}

static void test_the_first_line_is_torn(void) {
    begin(DRV_FRAMING_ASCII, 0);
    feed_text("3,4.5\n1.23,4.5\n");
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_TRUE(decoder.packet.values[0] == 1.23);
    TEST_ASSERT_EQUAL_UINT64(0, decoder.damaged);
}

static void test_a_new_width_is_believed_after_three_lines(void) {
    begin(DRV_FRAMING_ASCII, 0);
    feed_text("x\n1,2\n1,2,3\n1,2,3\n4,5,6\n");
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_INT(3, decoder.packet.fields);
    TEST_ASSERT_TRUE(decoder.packet.values[0] == 4);
    TEST_ASSERT_EQUAL_UINT64(2, decoder.damaged);
}

static void test_the_counter_of_a_line(void) {
    begin(DRV_FRAMING_ASCII, 2);
    feed_text("x\n0.5,41\n0.5,4.5\n0.5,-1\n0.5,43\n");
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_TRUE(decoder.packet.counted);
    TEST_ASSERT_EQUAL_UINT32(41, decoder.packet.sequence);
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT32(43, decoder.packet.sequence);
    TEST_ASSERT_EQUAL_UINT64(2, decoder.damaged);
}

static void test_an_endless_line_ends_somewhere(void) {
    char noise[3000];
    memset(noise, '1', sizeof noise);
    begin(DRV_FRAMING_ASCII, 0);
    feed_text("x\n1\n");
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    feed(noise, sizeof noise);
    feed_text("2\n3\n"); // the 2 is the end of the noise
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_TRUE(decoder.packet.values[0] == 3);
    TEST_ASSERT_EQUAL_UINT64(2048, decoder.skipped);
}

static void test_witmotion_log(void) {
    static const uint8_t log[] = {
        0x12, 0x34,                                                       // end of a packet
        0x55, 0x50, 1,    2,    3,    4,    5,    6,    7,    8,    0xC9, // time of day: not ours
        0x55, 0x51, 0x00, 0x08, 0x00, 0x80, 0xFF, 0x7F, 0x64, 0x09, 0x19, // +1 g, -16 g, all but 16 g
        0x55, 0x52, 0x00, 0x40, 0x00, 0xC0, 0x01, 0x00, 0x00, 0x00, 0xA8, // +1000, -1000 deg/s, one step
        0x55, 0x51, 0x00, 0x08, 0x00, 0x80, 0xFF, 0x7F, 0x64, 0x09, 0x1A, // sum wrong
        0x55, 0x53, 0x00, 0x40, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xE8, // 90 deg
    };
    begin(DRV_FRAMING_WITMOTION, 0);
    feed(log, sizeof log);
    const double* v = decoder.packet.values;
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_INT(0, decoder.packet.first_field);
    TEST_ASSERT_TRUE(v[0] == 1 && v[1] == -16 && v[2] == 16 * 32767.0 / 32768);
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_INT(3, decoder.packet.first_field);
    TEST_ASSERT_TRUE(v[0] == 1000 && v[1] == -1000 && v[2] == 2000.0 / 32768);
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_INT(6, decoder.packet.first_field);
    TEST_ASSERT_TRUE(v[0] == 90 && v[1] == 0 && v[2] == 0);
    TEST_ASSERT_EQUAL_INT(0, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT64(1, decoder.damaged);
}

/// Header and payload as given, floats as 0.5, 1.5, …; the sum is put behind.
static size_t vectornav(uint8_t* out, const uint8_t* header, size_t header_bytes, size_t payload_bytes) {
    memcpy(out, header, header_bytes);
    for (size_t i = 0; i + 4 <= payload_bytes; i += 4) {
        const float value = (float)(i / 4) + 0.5F;
        memcpy(out + header_bytes + i, &value, 4); // the test runs on a little-endian machine, as the device does
    }
    const size_t length = header_bytes + payload_bytes;
    const uint16_t sum = drv_crc16_ccitt(0, out + 1, length - 1);
    out[length] = (uint8_t)(sum >> 8);
    out[length + 1] = (uint8_t)sum;
    return length + 2;
}

static void test_vectornav_log(void) {
    static const uint8_t imu[] = {0xFA, 0x01, 0x21, 0x01};              // TimeStartup, AngularRate, Accel
    static const uint8_t both[] = {0xFA, 0x05, 0x00, 0x02, 0x00, 0x02}; // common: Imu; IMU group: Accel
    static const uint8_t none[] = {0xFA, 0x01, 0x08, 0x00};             // YawPitchRoll alone
    static const uint8_t gps[] = {0xFA, 0x08, 0x01, 0x00};              // a group that is not known
    uint8_t packet[128];
    begin(DRV_FRAMING_VECTORNAV, 0);
    feed_text("$VNYMR,1*5A\r\n");
    size_t length = vectornav(packet, imu, sizeof imu, 32);
    const uint64_t startup = UINT64_C(123456789012345);
    memcpy(packet + 4, &startup, 8);
    const uint16_t sum = drv_crc16_ccitt(0, packet + 1, length - 3);
    packet[length - 2] = (uint8_t)(sum >> 8);
    packet[length - 1] = (uint8_t)sum;
    feed(packet, length);
    const double* v = decoder.packet.values;
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_TRUE(decoder.packet.timed);
    TEST_ASSERT_EQUAL_UINT64(startup, decoder.packet.time_ns);
    TEST_ASSERT_TRUE(v[3] == 2.5 && v[4] == 3.5 && v[5] == 4.5); // rate stands before acceleration in the packet
    TEST_ASSERT_TRUE(v[0] == 5.5 && v[1] == 6.5 && v[2] == 7.5);
    feed(packet, length - 1);
    TEST_ASSERT_EQUAL_INT(0, drv_decoder_next(&decoder)); // one byte is missing
    feed(packet + length - 1, 1);
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    feed(packet, vectornav(packet, both, sizeof both, 24 + 12));
    TEST_ASSERT_EQUAL_INT(1, drv_decoder_next(&decoder));
    TEST_ASSERT_FALSE(decoder.packet.timed);
    TEST_ASSERT_TRUE(v[0] == 6.5 && v[2] == 8.5); // compensated before uncompensated
    TEST_ASSERT_TRUE(v[3] == 0.5 && v[5] == 2.5);
    feed(packet, vectornav(packet, none, sizeof none, 12));
    feed(packet, vectornav(packet, gps, sizeof gps, 8));
    TEST_ASSERT_EQUAL_INT(0, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT64(14, decoder.skipped);
    length = vectornav(packet, imu, sizeof imu, 32);
    packet[9] ^= 4;
    feed(packet, length);
    packet[9] ^= 4;
    feed(packet, length);
    TEST_ASSERT_EQUAL_INT(2, drv_decoder_next(&decoder));
    TEST_ASSERT_EQUAL_UINT64(1, decoder.damaged);
}

/// Whatever arrives: no packet of more than its room, no endless loop, every byte used or kept.
static void test_noise_of_every_framing(void) {
    uint32_t random = 1;
    for (int framing = 0; framing < DRV_FRAMINGS; ++framing) {
        begin((drv_framing_t)framing, framing == DRV_FRAMING_ASCII ? 1 : 0);
        for (int round = 0; round < 4000; ++round) {
            uint8_t noise[97];
            for (size_t i = 0; i < sizeof noise; ++i) {
                random = random * 1664525U + 1013904223U;
                noise[i] = (uint8_t)(random >> 24);
                if (framing == DRV_FRAMING_ASCII) noise[i] = (uint8_t)"0123456789.,-e \n:;x\t"[noise[i] % 20];
                if (framing == DRV_FRAMING_WITMOTION && i % 11 < 2) noise[i] = i % 11 ? 0x51 : 0x55;
                if (framing == DRV_FRAMING_VECTORNAV && i % 23 < 2) noise[i] = i % 23 ? 1 : 0xFA;
            }
            feed(noise, sizeof noise);
            while (drv_decoder_next(&decoder))
                TEST_ASSERT_TRUE(decoder.packet.fields * decoder.packet.samples <= DRV_PACKET_VALUES &&
                                 decoder.packet.first_field + decoder.packet.fields <=
                                     (int)drv_framings[framing].limit);
        }
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_lines_of_every_habit);
    RUN_TEST(test_lines_that_are_none);
    RUN_TEST(test_the_first_line_is_torn);
    RUN_TEST(test_a_new_width_is_believed_after_three_lines);
    RUN_TEST(test_the_counter_of_a_line);
    RUN_TEST(test_an_endless_line_ends_somewhere);
    RUN_TEST(test_witmotion_log);
    RUN_TEST(test_vectornav_log);
    RUN_TEST(test_noise_of_every_framing);
    return UNITY_END();
}
