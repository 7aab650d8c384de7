// SPDX-License-Identifier: MIT
// PURPOSE  runs a sketch (-DSKETCH="file.ino") over the record of codes.h: the converter gives its codes, time goes on by half a
//          period with each look at the clock; what the sketch sends goes to board_write()
#include "Arduino.h"
#include "Arduino_CAN.h"
#include "codes.h"
extern "C" {
#include "board.h"
}

enum { CHANNELS_OF_RECORD = 4, LOOK_US = 500 };
static uint32_t now_us, reads;
serial_t Serial;
can_t CAN;

uint32_t micros() { return now_us += LOOK_US; }
int analogRead(uint8_t pin) { return codes[reads++ / CHANNELS_OF_RECORD][pin] + 2048; }

size_t serial_t::write(const uint8_t* bytes, size_t count) {
    for (size_t i = 0; i < count; ++i) board_write(bytes[i]);
    return count;
}

void serial_t::print(const char* text) {
    while (*text) board_write((uint8_t)*text++);
}

void serial_t::println(const char* text) {
    print(text);
    print("\n");
}

static void digits_of(uint64_t value, int least) {
    char text[24], *at = text + sizeof text;
    *--at = 0;
    for (; value > 0 || least > 0; value /= 10, --least) *--at = (char)('0' + value % 10);
    Serial.print(at);
}

void serial_t::print(double value, int digits) {
    uint64_t power = 1;
    for (int i = 0; i < digits; ++i) power *= 10;
    const uint64_t whole = (uint64_t)(value * (double)power + 0.5); // the sketches print nothing negative
    digits_of(whole / power, 1);
    print(".");
    digits_of(whole % power, digits);
}

int can_t::write(const CanMsg& message) {
    static const char hex[] = "0123456789ABCDEF";
    Serial.print("(");
    digits_of(now_us / 1000000, 1);
    Serial.print(".");
    digits_of(now_us % 1000000, 6);
    Serial.print(") can0 ");
    for (int shift = 8; shift >= 0; shift -= 4) board_write((uint8_t)hex[message.id >> shift & 15]);
    board_write('#');
    for (int i = 0; i < message.count; ++i) {
        board_write((uint8_t)hex[message.data[i] >> 4]);
        board_write((uint8_t)hex[message.data[i] & 15]);
    }
    board_write('\n');
    return 1;
}

#include SKETCH

int main() {
    board_start();
    setup();
    while (reads < CHANNELS_OF_RECORD * SAMPLES) loop();
    return 0;
}
