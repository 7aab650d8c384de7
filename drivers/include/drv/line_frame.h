// SPDX-License-Identifier: MIT
/// @file line_frame.h
/// How a sample off a serial line travels as a drv_frame_t, so that alignment, counting of losses, logs and replay are
/// those of CAN frames. Up to seven fields a frame: bytes 0-3 the number of the sample, 4-7 nothing, then float64 each,
/// all little-endian; NaN where a field is empty. The identifier says which fields. Flagged FD, 64 bytes.
#ifndef DRV_LINE_FRAME_H
#define DRV_LINE_FRAME_H

#include <drv/codec.h>
#include <drv/decoder.h>
#include <drv/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { DRV_LINE_FRAME_BYTES = 64, DRV_LINE_FRAME_FIELDS = 7 };

/// Where a field of a framing stands. @return the identifier of its frame; `signal` is prepared, scale 1, offset 0
uint32_t drv_line_frame_field(drv_framing_t framing, unsigned field, drv_signal_t* signal);

/// The counter of a sample with this many bits, 2..32.
void drv_line_frame_counter(unsigned bits, drv_signal_t* signal);

/// Fill id, flags, length and data. @param values  the fields of this frame, `count` <= 7 of them
void drv_line_frame_fill(drv_frame_t* frame, uint32_t id, uint32_t sequence, const double* values, unsigned count);

#ifdef __cplusplus
}
#endif
#endif
