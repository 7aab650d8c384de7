// SPDX-License-Identifier: MIT
/// @file Arduino.h
/// As much of the Arduino core as the sketches of packaging/arduino call, on a board of tests/embedded/node/board.h.
#ifndef STUB_ARDUINO_H
#define STUB_ARDUINO_H

#include <stddef.h>
#include <stdint.h>

enum { A0, A1, A2, A3 };

uint32_t micros();
int analogRead(uint8_t pin);
inline void analogReadResolution(int) {}
void setup();
void loop();

struct serial_t {
    void begin(unsigned long) {}
    size_t write(const uint8_t* bytes, size_t count);
    void print(const char* text);
    void print(double value, int digits);
    void println(const char* text);
};
extern serial_t Serial;

#endif
