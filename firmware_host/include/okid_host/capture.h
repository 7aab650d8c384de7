/* SPDX-License-Identifier: MIT */
/**
 * @file capture.h
 * @brief Frames and bytes of devices in; samples on the grid, gaps, events and the result out. Part of okid_host.h.
 *
 * A capture is what `okid run` and `okid replay` do between the device and the screen: frames are decoded and placed on the
 * sample grid by counter or cadence, losses become gaps with a cause, triggers and hits are detected, nodes on clocks
 * of their own are resampled, and the modes are identified while samples come. Only the reading of the device is the caller's:
 * it hands over frames or bytes in batches, as many as it has. The same frames give the same samples, gaps, events and
 * result, however they are cut into batches, and those of `okid replay` of the same log.
 *
 * Time is host time, ns since 1970; it is taken at microseconds, as a log keeps it.
 */
#ifndef OKID_HOST_CAPTURE_H
#define OKID_HOST_CAPTURE_H

#include <drv/frame.h>
#include <okid_host.h>
#include <okid_host/files.h>

#ifdef __cplusplus
extern "C" {
#endif

/** One capture: from the first frame to the result. */
typedef struct okid_host_capture_t okid_host_capture_t;

/** What a capture is to do. Texts are read during okid_host_capture_create() only. */
typedef struct okid_host_capture_options_t {
    uint32_t size;        /**< sizeof this; set by okid_host_capture_defaults() */
    int32_t identify;     /**< 1 (default); 0 = samples, gaps and counts only: [publish], [record] and triggers rest */
    int32_t live;         /**< 1 = from devices: the clock does not wait, alarms call their command; default 0 */
    int32_t record;       /**< 1 = journals as [record] asks for, where it does; default 0 */
    int32_t table;        /**< 1 = modes and result on stdout as `okid run` shows them; default 0 */
    int32_t keep_samples; /**< 1 = samples wait for okid_host_capture_rows(); default 0 */
    int32_t keep_events;  /**< 1 = events wait for okid_host_capture_events(); default 0 */
    int32_t reserved;     /**< 0 */
    const char* events;   /**< file for events as JSON lines, "-" = stdout, NULL (default) = none */
    const char* json;     /**< file for the result, "-" = stdout, NULL (default) = none */
    double duration_s;    /**< stream seconds to end after, 0 (default) = none */
    int64_t trigger_ns; /**< when the edge of a GPIO line came, for a log, which holds none; 0 (default) = not known */
} okid_host_capture_options_t;

/** A run of samples. */
typedef struct okid_host_rows_t {
    int64_t first;      /**< index of the first one, counted from the first sample of the grid */
    int64_t count;      /**< samples; 0 = nothing waits */
    const double* rows; /**< one number a channel, sample by sample, NaN = missing; NULL = all of them are missing */
} okid_host_rows_t;

/** The defaults named above. */
OKID_HOST_API void okid_host_capture_defaults(okid_host_capture_options_t* options);

/**
 * Begins a capture of the buses of a configuration, of which it keeps a copy. No device is opened but the GPIO lines of a
 * live capture. 0, 2 or 4.
 */
OKID_HOST_API int okid_host_capture_create(const okid_host_config_t* config, const okid_host_capture_options_t* options,
                                           okid_host_capture_t** out);

/** Without okid_host_capture_finish() there is no result; NULL is taken too. */
OKID_HOST_API void okid_host_capture_delete(okid_host_capture_t* self);

/**
 * Frames as they came, of any buses of the config (`bus` is the index there). Error messages of a controller
 * (DRV_FRAME_ERROR) are counted, remote requests are no samples. What comes when the capture is done is left out.
 */
OKID_HOST_API int okid_host_capture_frames(okid_host_capture_t* self, const drv_frame_t* frames, size_t count);

/**
 * Bytes of a serial or slcan line as they came, in any pieces.
 * @param time_ns  when the newest of them arrived; 0 = not known (a file of bytes): by the device's clock, else one sample
 *                 after another
 */
OKID_HOST_API int okid_host_capture_bytes(okid_host_capture_t* self, size_t bus, const uint8_t* bytes, size_t count,
                                          int64_t time_ns);

/** A bus went away (up 0) or is back (1): what is lost meanwhile has the cause link_down. */
OKID_HOST_API int okid_host_capture_link(okid_host_capture_t* self, size_t bus, int32_t up);

/** Frames that the source of a bus knows to have lost since the beginning: for want of room in a socket, or in the driver. */
OKID_HOST_API int okid_host_capture_lost(okid_host_capture_t* self, size_t bus, uint64_t socket_overflow,
                                         uint64_t driver);

/** An edge of the trigger line. Nothing comes of it when none is waited for. */
OKID_HOST_API int okid_host_capture_edge(okid_host_capture_t* self, int64_t time_ns);

/** Live: trigger lines, lamps, journals and a service manager are served. At least every 0.1 s while nothing comes. */
OKID_HOST_API int okid_host_capture_serve(okid_host_capture_t* self);

/** A journal (.okj) or a log of `candump -L`, opened for okid_host_capture_play(). 0 or 2. */
OKID_HOST_API int okid_host_capture_open(okid_host_capture_t* self, const char* log);

/** The next frames of the log. @param played  out: how many; fewer than asked for = the end of the log, or done */
OKID_HOST_API int okid_host_capture_play(okid_host_capture_t* self, size_t frames, size_t* played);

/** 1 = as many samples or hits as were asked for have come. */
OKID_HOST_API int32_t okid_host_capture_done(const okid_host_capture_t* self);

/**
 * The next run of samples that waits, all channels of the config: inputs, outputs, others.
 * @param raw  1 = numbers as they stand in the frames; 0 = in SI units, as they are identified
 * @param out  valid until the next call on this capture
 */
OKID_HOST_API int okid_host_capture_rows(okid_host_capture_t* self, int32_t raw, okid_host_rows_t* out);

/** Events that wait, one JSON object a line, as `okid run --events` writes them; valid until the next call, never NULL. */
OKID_HOST_API const char* okid_host_capture_events(okid_host_capture_t* self);

/** The counts by now as a stats event; valid until the next call. NULL: okid_host_error() says why. */
OKID_HOST_API const char* okid_host_capture_stats(okid_host_capture_t* self);

/**
 * The stream ends: what waits goes out, the last stats, then the result, which is the last event. 0; 3 = no model
 * (samples and stats are there all the same); 4. Nothing can be put in afterwards.
 */
OKID_HOST_API int okid_host_capture_finish(okid_host_capture_t* self);

/**
 * A packet of the project's own serial stream (docs/wire-protocol.md), as a node sends it.
 * @param format  of the numbers: 0 int16, 1 int24, 2 float32
 * @param values  channels x samples, sample by sample; codes of formats 0 and 1 are whole numbers
 * @return bytes written to `out`, the closing 0 included; 0 = the samples do not fit a packet, or the packet not `out`
 */
OKID_HOST_API size_t okid_host_packet_encode(int32_t format, size_t channels, size_t samples, uint32_t sequence,
                                             uint32_t time_us, const double* values, uint8_t* out, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif
