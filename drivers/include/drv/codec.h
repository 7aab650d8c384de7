// SPDX-License-Identifier: MIT
/// @file codec.h
/// Signals inside frames: where their bits stand and what they mean. Pure arithmetic, no state.
///
/// The start bit follows the DBC: bit n is bit n%8 of byte n/8; little-endian (Intel) signals name their least
/// significant bit, big-endian (Motorola) ones their most significant bit.
#ifndef DRV_CODEC_H
#define DRV_CODEC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// What the bits of a signal are.
typedef enum drv_value_t {
    DRV_VALUE_INTEGER, ///< a whole number
    DRV_VALUE_FLOAT32, ///< IEEE 754, 32 bits
    DRV_VALUE_FLOAT64  ///< IEEE 754, 64 bits
} drv_value_t;

/// Where a number stands in a frame.
typedef struct drv_signal_t {
    uint16_t start_bit; ///< see above
    uint16_t length;    ///< 1..64 bits; 32 and 64 for the float types
    uint8_t big_endian; ///< 1 = Motorola
    uint8_t is_signed;  ///< 1 = two's complement
    drv_value_t value;  ///< what the bits are
    double scale;       ///< physical = raw * scale + offset
    double offset;      ///< in physical units
    // Filled by drv_signal_prepare():
    uint8_t first; ///< first byte touched
    uint8_t bytes; ///< bytes touched, 1..9
    uint8_t shift; ///< bits below the signal in those bytes
    uint64_t mask; ///< of the bits of the signal
} drv_signal_t;

/// Check the layout and work out the fast path. @return NULL, or a static sentence that says what is wrong
const char* drv_signal_prepare(drv_signal_t* self);

/// Bytes a frame must have to carry the signal.
size_t drv_signal_bytes(const drv_signal_t* self);

/// The raw bits, sign-extended when signed; floats give their bit pattern. @param data  must be readable for 64 bytes
/// @return 1, or 0 when the frame is too short
int drv_signal_raw(const drv_signal_t* self, const uint8_t* data, size_t len, int64_t* raw);

/// The number that scale and offset are applied to: the raw integer or the float. Exact up to 53 bits.
double drv_signal_number(const drv_signal_t* self, int64_t raw);

/// Decode to engineering units. @return 1, or 0 when the frame is too short
int drv_signal_decode(const drv_signal_t* self, const uint8_t* data, size_t len, double* physical);

/// Put raw bits into a frame. @return 1, or 0 when the frame is too short
int drv_signal_put(const drv_signal_t* self, uint8_t* data, size_t len, int64_t raw);

/// Encode from engineering units: nearest integer, saturated at the ends of the range.
/// @return 1; 2 when it had to saturate; 0 when the frame is too short or the value is not a number
int drv_signal_encode(const drv_signal_t* self, uint8_t* data, size_t len, double physical);

#ifdef __cplusplus
}
#endif
#endif
