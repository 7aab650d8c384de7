// SPDX-License-Identifier: MIT
/// @file fault_source.h
/// A source of frames that hands on those of another one and damages the stream on the way, by a seed; it keeps the truth
/// of what it did. The other source is a made one: lanes of frames with a counter.
#ifndef TESTS_FAULT_FAULT_SOURCE_H
#define TESTS_FAULT_FAULT_SOURCE_H

#include <drv/host_clock.h>
#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FAULT_LANES = 4, FAULT_REORDER_MOST = 8, FAULT_QUEUE = 256 };

typedef enum fault_kind_t {
    FAULT_DROP,         ///< a frame is not there
    FAULT_OVERFLOW,     ///< some are not there, and the next one says that the socket was full
    FAULT_DUPLICATE,    ///< a frame comes twice
    FAULT_REORDER,      ///< a frame comes up to eight places late
    FAULT_FLIP_DATA,    ///< one bit of the payload, not seen by anyone
    FAULT_FLIP_COUNTER, ///< one bit of the counter
    FAULT_TRUNCATE,     ///< a frame too short for its signals
    FAULT_OVERSIZE,     ///< a length no frame has
    FAULT_FOREIGN,      ///< a frame with an identifier nobody knows
    FAULT_ERROR_FRAME,  ///< an error message or a remote request comes in between
    FAULT_DOWN,         ///< ENETDOWN, then frames are missing
    FAULT_GONE,         ///< ENODEV some times, then frames are missing
    FAULT_INTERRUPT,    ///< EINTR, some times over
    FAULT_AGAIN,        ///< EAGAIN or nothing, some times over
    FAULT_FAIL,         ///< EIO, ENOMEM or ENOBUFS without a loss
    FAULT_SHORT,        ///< fewer frames a read than were asked for
    FAULT_CLOCK,        ///< the clock of the stamps is set by an hour, either way
    FAULT_STAMP_WRAP,   ///< the controller's own stamp begins anew
    FAULT_KINDS
} fault_kind_t;

/// "drop", "duplicate", … Static text.
const char* fault_name(fault_kind_t kind);

typedef struct fault_plan_t {
    uint32_t seed;
    uint32_t per_mille[FAULT_KINDS]; ///< how often, of each frame
    int64_t samples;                 ///< of each lane; the first 20 and the last 40 are left in peace
    int32_t lanes;                   ///< 1..FAULT_LANES, identifiers from 0x100 on
    uint32_t first_counter;          ///< 16 bits at the front of each frame, then the sample as 32 bits at byte 4
    int64_t period_ns;
    int32_t raw_stamps; ///< 1 = a set clock is seen in the stamps, as in a log; 0 = they are carried to host time
} fault_plan_t;

typedef struct fault_source_t {
    drv_source_t source; ///< what is read
    fault_plan_t plan;
    uint64_t done[FAULT_KINDS]; ///< faults made, of frames or of reads
    uint64_t lost[FAULT_KINDS]; ///< frames that do not reach the grid, by what took them
    uint64_t good;              ///< frames handed on that the grid can place
    // private
    uint64_t random;
    drv_host_clock_t clock;
    int64_t sample, clock_ns, wrap_ns, last_clock_at, last_clock_sent, last_flip_at;
    int32_t lane, missing;
    fault_kind_t missing_by;
    uint8_t loss;
    int pending_error, pending_reads, clock_just_set;
    drv_frame_t queue[FAULT_QUEUE]; ///< frames on their way, with the place each is due at
    int64_t due[FAULT_QUEUE], sent;
    int32_t queued;
    int at_end;
} fault_source_t;

/// Ready to be read; open() and close() do nothing.
void fault_source_make(fault_source_t* self, const fault_plan_t* plan);

#ifdef __cplusplus
}
#endif
#endif
