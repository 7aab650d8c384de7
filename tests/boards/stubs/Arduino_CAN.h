// SPDX-License-Identifier: MIT
/// @file Arduino_CAN.h
/// As much of Arduino's CAN interface as stream_node.ino calls: a frame comes out as a line of candump -L.
#ifndef STUB_ARDUINO_CAN_H
#define STUB_ARDUINO_CAN_H

#include "Arduino.h"

enum class CanBitRate : int { BR_500k = 500000 };
inline uint32_t CanStandardId(uint32_t id) { return id; }

struct CanMsg {
    CanMsg(uint32_t id_, uint8_t count_, const uint8_t* data_) : id(id_), count(count_), data(data_) {}
    uint32_t id;
    uint8_t count;
    const uint8_t* data;
};

struct can_t {
    bool begin(CanBitRate) { return true; }
    int write(const CanMsg& message);
};
extern can_t CAN;

#endif
