// SPDX-License-Identifier: MIT
/// @file can_error.h
/// Error messages of a CAN controller: frames with DRV_FRAME_ERROR, whose identifier holds the classes of the error.
#ifndef DRV_CAN_ERROR_H
#define DRV_CAN_ERROR_H

#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Book one error message under its classes; `counts->last_error` has its meaning in words.
/// @param data  8 bytes
void drv_can_error_count(drv_stats_t* counts, uint32_t id, const uint8_t* data);

/// What an error message says, such as "bus-off; no acknowledgement (tx errors 248, rx errors 0)".
/// @param data  8 bytes  @param capacity  of `out`, cut when it is too small
void drv_can_error_text(uint32_t id, const uint8_t* data, char* out, size_t capacity);

#ifdef __cplusplus
}
#endif
#endif
