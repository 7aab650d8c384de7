// SPDX-License-Identifier: MIT
/// @file source.h
/// Where frames come from: one set of operations for a CAN socket and a recorded log.
///
/// open() may allocate; read() and stats() never do. One thread reads a source. After an error `error` holds one
/// sentence that says what was wrong; the value returned is -errno.
#ifndef DRV_SOURCE_H
#define DRV_SOURCE_H

#include <drv/decoder.h>
#include <drv/frame.h>
#include <drv/link.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes.
enum {
    DRV_NAME_BYTES = 16,          ///< longest name of an interface, with its closing 0
    DRV_ERROR_BYTES = 320,        ///< longest sentence about an error
    DRV_ERROR_TEXT_BYTES = 120,   ///< longest text of an error message of a controller
    DRV_MAX_FILTERS = 512,        ///< identifiers a source can be asked for
    DRV_MAX_BUSES = 32,           ///< interfaces of a source
    DRV_RECEIVE_BUFFER = 40 << 20 ///< bytes; the kernel doubles it, and then 100,000 frames of 768 bytes fit
};

/// read() at the end of a log.
#define DRV_END (-4095)

/// One identifier wanted, or many alike; nothing else passes the kernel.
typedef struct drv_filter_t {
    uint32_t id;      ///< 11 or 29 bits
    uint8_t extended; ///< 1 = 29 bits
    uint32_t mask;    ///< bits of the identifier that must agree with `id`; 0 = all of them
} drv_filter_t;

/// Of a serial line.
typedef struct drv_line_config_t {
    const char* device;    ///< best of /dev/serial/by-id/: that name finds the device again after it was unplugged;
                           ///< NULL = the bytes come from drv_line_push()
    int32_t baud;          ///< bit/s of the line
    drv_framing_t framing; ///< serial
    int32_t counter;       ///< serial, lines of text: 1 + the field that counts samples, 0 = none
    double rate_hz;        ///< serial: of the samples, for the stamps of those that share a packet
    int32_t bitrate;       ///< slcan: of the CAN bus, bit/s; 0 = leave the adapter's own
    int32_t dbitrate;      ///< slcan: of the data of FD frames; 0 = leave it
    const char* btr;       ///< slcan: bit timing registers as the adapter wants them (command s), instead of bitrate
} drv_line_config_t;

/// What to open.
typedef struct drv_source_config_t {
    const char*
        interfaces[DRV_MAX_BUSES]; ///< socket: the first one; log: those to deliver, frame.bus is the index here
    int32_t interface_count;       ///< log: 0 = deliver every interface as bus 0
    /// socket: of this USB adapter (drv_link_find) instead of interfaces[0]; NULL = none
    const char* adapter;
    int32_t adapter_channel;     ///< of it
    const char* path;            ///< log only
    const drv_filter_t* filters; ///< socket only; NULL = everything
    int32_t filter_count;        ///< of them
    int32_t buffer_bytes;        ///< receive buffer asked for, 0 = DRV_RECEIVE_BUFFER
    drv_line_config_t line;      ///< serial and slcan only
} drv_source_config_t;

/// How frames were stamped, best last.
typedef enum drv_stamp_t {
    DRV_STAMP_NONE,    ///< not known
    DRV_STAMP_US,      ///< by the kernel, microseconds
    DRV_STAMP_NS,      ///< by the kernel, nanoseconds
    DRV_STAMP_HARDWARE ///< by the controller
} drv_stamp_t;

/// Counts since open().
typedef struct drv_stats_t {
    uint64_t received;      ///< data frames delivered
    uint64_t lost_overflow; ///< frames the kernel dropped because the receive buffer was full
    uint64_t lost_driver;   ///< frames the driver dropped, and times the controller's own queue overran
    uint64_t error_frames;  ///< error messages of the controller; the next seven count those of one class
    uint64_t bus_off;       ///< entered bus-off
    uint64_t restarts;      ///< after bus-off
    uint64_t no_ack;        ///< frames sent that no node acknowledged
    uint64_t tx_timeouts;   ///< sending gave up
    uint64_t rx_overflows;  ///< the controller's receive queue overran
    uint64_t error_passive; ///< entered the error-passive state
    uint64_t bus_errors;    ///< bit, stuff, form, CRC errors on the wire
    uint64_t remote;        ///< remote requests, not delivered
    uint64_t foreign;       ///< log: frames of other interfaces, not delivered
    uint64_t torn;          ///< log: 1 = its last line had no end and was no frame: left out
    uint64_t link_down;     ///< times the interface went down or away
    uint64_t reopened;      ///< times the socket was made again after the interface had gone
    uint64_t read_errors;   ///< other errors of the socket
    int32_t buffer_bytes;   ///< receive buffer granted
    int32_t link_is_down;   ///< 1 = down or away now
    uint64_t bytes;         ///< serial and slcan: bytes read
    uint64_t damaged;       ///< serial: packets or lines refused; slcan: lines that are no frame
    uint64_t skipped;       ///< serial: bytes that belonged to no packet
    uint64_t refused;       ///< slcan: commands and frames the adapter answered with an error (bell)
    uint64_t line_overruns; ///< serial line: bytes lost in the hardware or the kernel, in lost_driver too
    uint64_t line_errors;   ///< serial line: bytes with a framing or parity error, as from a wrong baud rate
    drv_stamp_t stamp;      ///< how frames were stamped
    drv_bus_state_t state;  ///< of the controller, as last reported
    uint32_t restart_ms;    ///< of the interface; 0 = it stays off after bus-off, or is virtual
    uint32_t bitrate;       ///< of the interface, bit/s; 0 = virtual
    /// socket: bound to this one now or last, "" = a source of another kind
    char interface[DRV_NAME_BYTES];
    char last_error[DRV_ERROR_TEXT_BYTES]; ///< what the newest error message said, "" = there was none
} drv_stats_t;

/// One source; open() begins it.
typedef struct drv_source_t drv_source_t;

/// What every kind of source can do.
typedef struct drv_source_ops_t {
    int (*open)(drv_source_t* self, const drv_source_config_t* config); ///< 0 or -errno
    int (*fd)(const drv_source_t* self);                                ///< to poll for reading, -1 = none just now
    int (*read)(drv_source_t* self, drv_frame_t* frames, int capacity); ///< frames, 0 = none now, DRV_END, -errno
    void (*stats)(drv_source_t* self, drv_stats_t* out);                ///< reads the kernel's drop counter too
    void (*close)(drv_source_t* self); ///< safe after a failed open; stats stay readable
} drv_source_ops_t;

/// A source that is open, or was.
struct drv_source_t {
    const drv_source_ops_t* ops; ///< its kind
    void* state;                 ///< of the implementation, between open and close
    drv_stats_t counts;          ///< since open()
    char error[DRV_ERROR_BYTES]; ///< one sentence, "" = none
};

extern const drv_source_ops_t drv_source_socketcan; ///< a CAN_RAW socket, classic and FD
extern const drv_source_ops_t drv_source_replay;    ///< a `candump -L` text log
extern const drv_source_ops_t drv_source_journal;   ///< a journal and the segments behind it, journal.h; every bus
extern const drv_source_ops_t drv_source_serial;    ///< a serial line of samples, line_frame.h
extern const drv_source_ops_t drv_source_slcan;     ///< a CAN adapter on a serial line

/// Bytes for a serial or slcan source that was opened without a device. They are not copied: read() until it returns 0.
/// @param arrived_ns  host time, 0 = not known: samples of a serial line are then stamped by the device's clock or, where
///                    it tells none, one sample period apart
void drv_line_push(drv_source_t* self, const uint8_t* bytes, size_t count, int64_t arrived_ns);

/// The line of such a source went away: what was begun is never finished, and the next frame is marked DRV_LOSS_LINK.
void drv_line_break(drv_source_t* self);

#ifdef __cplusplus
}
#endif
#endif
