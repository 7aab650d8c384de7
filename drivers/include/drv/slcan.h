// SPDX-License-Identifier: MIT
/// @file slcan.h
/// CAN frames as text on a serial line (LAWICEL CAN232/CANUSB and the many adapters that follow it, FD as CANable 2 does).
#ifndef DRV_SLCAN_H
#define DRV_SLCAN_H

#include <drv/frame.h>
#include <drv/serial_port.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Longest line: FD, 29-bit identifier, 64 bytes, time stamp, end of line.
enum { DRV_SLCAN_BYTES = 1 + 8 + 1 + 128 + 4 + 1, DRV_SLCAN_STAMP_MS = 60000 };

/// One line without its end. @param stamp_ms  out: the adapter's stamp, 0..59999, or -1 without one
/// @return 1 = a frame (flags, id, len and data are filled), 0 = an answer to a command, -1 = neither
int drv_slcan_parse(const char* line, size_t length, drv_frame_t* frame, int* stamp_ms);

/// One frame with its end of line. @return characters, -1 for an error frame or when capacity is too small
int drv_slcan_format(char* out, size_t capacity, const drv_frame_t* frame);

/// What opens the channel: closed first, bit rate set, opened. @param btr  registers, or NULL for `bitrate` (0 = as it is)
/// @return characters, -1 when the protocol has no command for one of the rates or capacity is too small
int drv_slcan_opening(char* out, size_t capacity, int32_t bitrate, int32_t dbitrate, const char* btr);

/// Frames onto a bus behind an adapter.
typedef struct drv_slcan_sink_t {
    drv_serial_t port;           ///< the line
    uint64_t sent;               ///< frames
    char error[DRV_ERROR_BYTES]; ///< one sentence, "" = none
} drv_slcan_sink_t;

/// Open the line and the channel behind it. @return 0, or -errno with `error` filled
int drv_slcan_sink_open(drv_slcan_sink_t* self, const drv_line_config_t* config);
/// Send one frame, as drv_sink_write().
int drv_slcan_sink_write(drv_slcan_sink_t* self, const drv_frame_t* frame, int patience_ms);
/// Closes the channel too. Safe when closed already.
void drv_slcan_sink_close(drv_slcan_sink_t* self);

#ifdef __cplusplus
}
#endif
#endif
