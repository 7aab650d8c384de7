// SPDX-License-Identifier: MIT
// PURPOSE  WitMotion's standard protocol to numbers: 0x55, kind, eight bytes, sum of the ten before modulo 256
// METHOD   find 0x55, check kind and sum; after a wrong one the search goes on one byte further
// REFERENCE WitMotion standard communication protocol: kinds 0x51 acceleration (full scale 16 g), 0x52 rate (2000 deg/s),
//          0x53 angle (180 deg), each three little-endian int16 of full scale 32768
#include <drv/decoder.h>

#include <string.h>

enum { SYNC = 0x55, BYTES = 11, FIRST_KIND = 0x50, LAST_KIND = 0x5F, ACCELERATION = 0x51, RATE, ANGLE };

drv_scan_t drv_scan_witmotion(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used) {
    const uint8_t* sync = memchr(bytes, SYNC, count);
    *used = sync ? (size_t)(sync - bytes) : count;
    if (*used > 0) return DRV_SCAN_NOISE;
    if (count < 2) return DRV_SCAN_MORE;
    const unsigned kind = bytes[1];
    if (kind < FIRST_KIND || kind > LAST_KIND) {
        *used = 1;
        return DRV_SCAN_NOISE;
    }
    if (count < BYTES) return DRV_SCAN_MORE;
    unsigned sum = 0;
    for (int i = 0; i < BYTES - 1; ++i) sum += bytes[i];
    if ((sum & 0xFF) != bytes[BYTES - 1]) {
        *used = 1;
        return DRV_SCAN_DAMAGED;
    }
    *used = BYTES;
    if (kind < ACCELERATION || kind > ANGLE) return DRV_SCAN_IDLE;
    const double scale = (kind == ACCELERATION ? 16.0 : kind == RATE ? 2000.0 : 180.0) / 32768.0;
    packet->counted = packet->timed = 0;
    packet->first_field = (uint16_t)(3 * (kind - ACCELERATION));
    packet->fields = 3;
    packet->samples = 1;
    for (unsigned i = 0; i < 3; ++i)
        packet->values[i] = scale * (int16_t)(bytes[2 + 2 * i] | (unsigned)bytes[3 + 2 * i] << 8);
    return DRV_SCAN_PACKET;
}
