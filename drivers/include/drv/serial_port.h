// SPDX-License-Identifier: MIT
/// @file serial_port.h
/// A serial line: 8 data bits, no parity, 1 stop bit, raw, any baud rate, for this program alone.
#ifndef DRV_SERIAL_PORT_H
#define DRV_SERIAL_PORT_H

#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Longest path of a device, with its closing 0.
enum { DRV_PATH_BYTES = 256 };

/// What the line's hardware refused, since it was opened.
typedef struct drv_serial_errors_t {
    uint32_t overrun; ///< bytes lost because they were not read in time, in the hardware or in the kernel
    uint32_t frame;   ///< bytes without a stop bit: a wrong baud rate, or a break
    uint32_t parity;  ///< bytes with a wrong parity
} drv_serial_errors_t;

/// A line that is open, or was.
typedef struct drv_serial_t {
    int fd;                      ///< -1 = closed
    int32_t baud;                ///< as the device took it
    int low_latency;             ///< 1 = the kernel was asked to hand bytes over at once, and agreed
    int latency_ms;              ///< of a USB adapter that tells it (16 is the usual default), -1 = tells none
    int counts_errors;           ///< 1 = the device counts what drv_serial_errors_t holds
    uint32_t counted[4];         ///< its counters at open
    char error[DRV_ERROR_BYTES]; ///< one sentence, "" = none
} drv_serial_t;

/// Open a device such as /dev/serial/by-id/…: locked against others (flock and TIOCEXCL), USB latency at its least.
/// @return 0, or -errno with `error` filled: -ENOENT not there, -EACCES not allowed, -EBUSY in use, -ENOTTY no serial
///         device, -EINVAL a baud rate that the device cannot make
int drv_serial_open(drv_serial_t* self, const char* path, int32_t baud);

/// Bytes that wait. @return bytes read, 0 = none now, -ENODEV when the device is gone (unplugged): close it then
int drv_serial_read(drv_serial_t* self, uint8_t* bytes, size_t capacity);

/// Write everything; a full queue is waited for, `patience_ms` in all. @return 0, or -errno with `error` filled
int drv_serial_write(drv_serial_t* self, const uint8_t* bytes, size_t count, int patience_ms);

/// What the hardware counted since open; zeros where it counts nothing.
void drv_serial_errors(drv_serial_t* self, drv_serial_errors_t* out);

/// Safe when closed already. What was written goes out first, for at most a tenth of a second.
void drv_serial_close(drv_serial_t* self);

#ifdef __cplusplus
}
#endif
#endif
