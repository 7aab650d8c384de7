// SPDX-License-Identifier: MIT
/// @file sink.h
/// Frames onto a CAN interface.
#ifndef DRV_SINK_H
#define DRV_SINK_H

#include <drv/frame.h>
#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

/// An interface that frames go to.
typedef struct drv_sink_t {
    int fd;                      ///< of the socket, -1 = closed
    uint64_t sent;               ///< frames
    uint64_t waits;              ///< times the queue of the interface was full (ENOBUFS)
    char error[DRV_ERROR_BYTES]; ///< one sentence, "" = none
} drv_sink_t;

/// Open an interface. @return 0, or -errno with `error` filled: -EAFNOSUPPORT kernel without CAN, -ENODEV no such interface, -ENETDOWN down
int drv_sink_open(drv_sink_t* self, const char* interface);

/// Send one frame; while the queue is full it is tried again for up to `patience_ms`. Error frames are skipped.
/// @return 0, or -errno with `error` filled
int drv_sink_write(drv_sink_t* self, const drv_frame_t* frame, int patience_ms);

/// Safe when closed already.
void drv_sink_close(drv_sink_t* self);

#ifdef __cplusplus
}
#endif
#endif
