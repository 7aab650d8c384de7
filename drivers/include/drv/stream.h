// SPDX-License-Identifier: MIT
/// @file stream.h
/// The project's own serial packets, the sender's side: no heap, no state, no floating point but float32 samples, for a
/// microcontroller node. docs/wire-protocol.md has the bytes; drv_scan_cobs() in decoder.h is the other side.
#ifndef DRV_STREAM_H
#define DRV_STREAM_H

#include <drv/cobs.h>

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Of the format.
enum {
    DRV_STREAM_VERSION = 1,                                       ///< in the first byte
    DRV_STREAM_HEADER = 12,                                       ///< bytes before the samples
    DRV_STREAM_OVERHEAD = 16,                                     ///< header and CRC
    DRV_STREAM_MAX_BYTES = 1024,                                  ///< header, samples and CRC together
    DRV_STREAM_ENCODED = DRV_COBS_BYTES(DRV_STREAM_MAX_BYTES) + 1 ///< longest packet on the wire, its 0 included
};

/// How a number stands in the packet; little-endian, two's complement.
typedef enum drv_stream_format_t {
    DRV_STREAM_INT16,  ///< 2 bytes
    DRV_STREAM_INT24,  ///< 3 bytes
    DRV_STREAM_FLOAT32 ///< 4 bytes
} drv_stream_format_t;

/// What stands before the numbers.
typedef struct drv_stream_header_t {
    drv_stream_format_t format; ///< of the numbers
    uint8_t channels;           ///< >= 1
    uint8_t samples;            ///< of each channel, >= 1
    uint32_t sequence;          ///< number of the first sample since the node started; wraps
    uint32_t time_us;           ///< the node's clock at the first sample; wraps
} drv_stream_header_t;

/// Bytes that the packet may need on the wire, its closing 0 included; 0 when it would be longer than a packet may be.
size_t drv_stream_bytes(const drv_stream_header_t* header);

/// Build a packet out of integer codes. @param codes  channels x samples, sample by sample; the low 16 or 24 bits go out
/// @return bytes to send, the closing 0 included; 0 when `capacity` is below drv_stream_bytes() or the header is invalid
size_t drv_stream_encode_codes(const drv_stream_header_t* header, const int32_t* codes, uint8_t* out, size_t capacity);

/// The same for DRV_STREAM_FLOAT32.
size_t drv_stream_encode_floats(const drv_stream_header_t* header, const float* values, uint8_t* out, size_t capacity);

#ifdef __cplusplus
}
#endif
#endif
