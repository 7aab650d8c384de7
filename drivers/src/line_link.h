// SPDX-License-Identifier: MIT
/// @file line_link.h
/// A serial line that comes back: read by the sources on it, opened again by its path after it was unplugged. Or one
/// without a device: its bytes are pushed (drv_line_push()). First in the state of every source on a line.
#ifndef DRV_LINE_LINK_H
#define DRV_LINE_LINK_H

#include <drv/serial_port.h>
#include <drv/source.h>

typedef struct line_link_t {
    drv_serial_t port;
    char path[DRV_PATH_BYTES];
    int32_t baud;
    int64_t next_try_ns; ///< CLOCK_MONOTONIC
    uint8_t loss;        ///< DRV_LOSS_… of the next frame
    drv_serial_errors_t seen;
    uint64_t overruns_before, errors_before; ///< of the times the line was open before
    int pushed;                              ///< 1 = no device: bytes come from drv_line_push()
    int broken;                              ///< pushed: what comes next is not the continuation of what came before
    const uint8_t* bytes;                    ///< pushed, not yet read
    size_t waiting;                          ///< of them
    int64_t pushed_ns;                       ///< when they arrived, 0 = not known
} line_link_t;

/// @return 0, or -errno with the source's `error` filled
int line_link_open(line_link_t* self, drv_source_t* source, const drv_line_config_t* config);

/// What has arrived. A line that hung up is closed; it is tried again at most ten times a second.
/// @param torn  out: 1 = what came before is never finished: the line is closed, or was just opened again
/// @return bytes, 0 = none now
int line_link_read(line_link_t* self, drv_source_t* source, uint8_t* bytes, size_t capacity, int* torn);

/// When the newest bytes arrived, host time; 0 = pushed without a time.
int64_t line_link_time(const line_link_t* self);

/// Bring the counts of the hardware up to date; bytes it lost mark the next frame.
void line_link_count(line_link_t* self, drv_source_t* source);

#endif
