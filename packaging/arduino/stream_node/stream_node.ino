// SPDX-License-Identifier: MIT
// Streams 1 force (A0) and 3 accelerations (A1 to A3) at 1 kHz: COBS packets on the serial line, read by okid with
// framing = "cobs"; with NODE_CAN defined, frames of drivers/proto/okid.dbc on the board's CAN controller.
#include <okid_core.h>

enum { CHANNELS = 4, EACH = 8, PERIOD_US = 1000 }; // EACH: samples of a packet
static const uint8_t pins[CHANNELS] = {A0, A1, A2, A3};
static uint32_t number, next_us;

#ifdef NODE_CAN
#include <Arduino_CAN.h>

/// A counter of 16 bits, then the codes, little-endian.
static void send_frame(uint32_t id, const int32_t* codes, int count) {
    uint8_t data[8] = {(uint8_t)number, (uint8_t)(number >> 8)};
    for (int i = 0; i < count; ++i) {
        data[2 + 2 * i] = (uint8_t)codes[i];
        data[3 + 2 * i] = (uint8_t)(codes[i] >> 8);
    }
    CAN.write(CanMsg(CanStandardId(id), sizeof data, data)); // a lost frame is a gap in the counter
}

static void send(const int32_t* codes, uint32_t) {
    send_frame(0x100, codes, 1);
    send_frame(0x101, codes + 1, 3);
}
#else
static int32_t waiting[CHANNELS * EACH];
static uint8_t packet[DRV_STREAM_ENCODED];

static void send(const int32_t* codes, uint32_t now_us) {
    static uint32_t first_us;
    const uint32_t place = number % EACH;
    if (place == 0) first_us = now_us;
    for (int c = 0; c < CHANNELS; ++c) waiting[place * CHANNELS + c] = codes[c];
    if (place + 1 < EACH) return;
    const drv_stream_header_t header = {DRV_STREAM_INT16, CHANNELS, EACH, number + 1 - EACH, first_us};
    Serial.write(packet, drv_stream_encode_codes(&header, waiting, packet, sizeof packet));
}
#endif

void setup() {
#ifdef NODE_CAN
    CAN.begin(CanBitRate::BR_500k);
#else
    Serial.begin(921600);
#endif
    analogReadResolution(12);
    next_us = micros();
}

void loop() {
    const uint32_t now_us = micros();
    if ((int32_t)(now_us - next_us) < 0) return;
    next_us += PERIOD_US;
    int32_t codes[CHANNELS];
    for (int c = 0; c < CHANNELS; ++c) codes[c] = analogRead(pins[c]) - 2048;
    send(codes, now_us);
    ++number;
}
