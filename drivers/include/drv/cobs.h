// SPDX-License-Identifier: MIT
/// @file cobs.h
/// Consistent overhead byte stuffing: any bytes as bytes other than 0, so that 0 can end a packet.
/// Source: S. Cheshire, M. Baker, IEEE/ACM Trans. Networking 7 (1999). No state, no heap: runs on a microcontroller.
#ifndef DRV_COBS_H
#define DRV_COBS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bytes that `count` bytes may grow to, without the 0 that ends the packet.
#define DRV_COBS_BYTES(count) ((count) + (count) / 254 + 1)

/// Encode. `out` needs DRV_COBS_BYTES(count) bytes; `bytes` may lie at the end of that same room.
/// @return bytes written, at least 1, none of them 0
size_t drv_cobs_encode(const uint8_t* bytes, size_t count, uint8_t* out);

/// Decode one packet without its 0. `out` may be `bytes` itself and never needs more than `count` bytes.
/// @return bytes written, or -1 when this is no encoded packet (empty, holds a 0, ends within a block)
ptrdiff_t drv_cobs_decode(const uint8_t* bytes, size_t count, uint8_t* out);

#ifdef __cplusplus
}
#endif
#endif
