// SPDX-License-Identifier: MIT
/// @file crc.h
/// Check sums of the serial protocols. Pure arithmetic, no state: runs on a microcontroller.
#ifndef DRV_CRC_H
#define DRV_CRC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// CRC-32 (IEEE 802.3, the one of zlib): polynomial 0x04C11DB7 reflected, begins and ends inverted.
/// @param before  result of the bytes before these, 0 at the start
uint32_t drv_crc32(uint32_t before, const uint8_t* bytes, size_t count);

/// CRC-16-CCITT: polynomial 0x1021, most significant bit first, begins with `before` (0 at the start), not inverted.
/// Over a packet with its own sum behind it (high byte first) the result is 0.
uint16_t drv_crc16_ccitt(uint16_t before, const uint8_t* bytes, size_t count);

#ifdef __cplusplus
}
#endif
#endif
