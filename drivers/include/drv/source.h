// SPDX-License-Identifier: MIT
/// @file source.h
/// Where frames come from: one set of operations for a CAN socket and a recorded log.
///
/// open() may allocate; read() and stats() never do. One thread reads a source. After an error `error` holds one
/// sentence that says what was wrong; the value returned is -errno.
#ifndef DRV_SOURCE_H
#define DRV_SOURCE_H

#include <drv/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { DRV_NAME_BYTES = 16, DRV_ERROR_BYTES = 320, DRV_MAX_FILTERS = 512, DRV_MAX_BUSES = 32 };

/// read() at the end of a log.
#define DRV_END (-4095)

/// One identifier wanted; nothing else passes the kernel.
typedef struct drv_filter_t {
    uint32_t id;
    uint8_t extended;
} drv_filter_t;

typedef struct drv_source_config_t {
    const char*
        interfaces[DRV_MAX_BUSES]; ///< socket: the first one; log: those to deliver, frame.bus is the index here
    int32_t interface_count;       ///< log: 0 = deliver every interface as bus 0
    const char* path;              ///< log only
    const drv_filter_t* filters;   ///< socket only; NULL = everything
    int32_t filter_count;
    int32_t buffer_bytes; ///< receive buffer asked for, 0 = 8 MiB
} drv_source_config_t;

/// How frames were stamped, best first.
typedef enum drv_stamp_t { DRV_STAMP_NONE, DRV_STAMP_US, DRV_STAMP_NS, DRV_STAMP_HARDWARE } drv_stamp_t;

/// Counts since open().
typedef struct drv_stats_t {
    uint64_t received;      ///< data frames delivered
    uint64_t lost_overflow; ///< frames the kernel dropped because the receive buffer was full
    uint64_t lost_driver;   ///< times the controller said its own queue overran
    uint64_t error_frames;  ///< error messages of the controller, the next two among them
    uint64_t bus_off;
    uint64_t restarts;
    uint64_t remote;      ///< remote requests, not delivered
    uint64_t foreign;     ///< log: frames of other interfaces, not delivered
    uint64_t torn;        ///< log: 1 = its last line had no end and was no frame: left out
    uint64_t link_down;   ///< times the interface went down or away
    uint64_t reopened;    ///< times the socket was made anew after the interface had gone
    uint64_t read_errors; ///< other errors of the socket
    int32_t buffer_bytes; ///< receive buffer granted
    int32_t link_is_down; ///< 1 = down or away now
    drv_stamp_t stamp;
} drv_stats_t;

typedef struct drv_source_t drv_source_t;

typedef struct drv_source_ops_t {
    int (*open)(drv_source_t* self, const drv_source_config_t* config); ///< 0 or -errno
    int (*fd)(const drv_source_t* self);                                ///< to poll for reading, -1 = none just now
    int (*read)(drv_source_t* self, drv_frame_t* frames, int capacity); ///< frames, 0 = none now, DRV_END, -errno
    void (*stats)(drv_source_t* self, drv_stats_t* out);                ///< reads the kernel's drop counter too
    void (*close)(drv_source_t* self); ///< safe after a failed open; stats stay readable
} drv_source_ops_t;

struct drv_source_t {
    const drv_source_ops_t* ops;
    void* state; ///< of the implementation, between open and close
    drv_stats_t counts;
    char error[DRV_ERROR_BYTES];
};

extern const drv_source_ops_t drv_source_socketcan; ///< a CAN_RAW socket, classic and FD
extern const drv_source_ops_t drv_source_replay;    ///< a `candump -L` text log

#ifdef __cplusplus
}
#endif
#endif
