// SPDX-License-Identifier: MIT
/// @file clock_fit.h
/// From the clock of a device to the clock of the host: offset and rate, with σ, out of pairs (device stamp, host time).
///
/// One object a device, fixed size, no heap; O(1) a pair but for one pair in up to DRV_CLOCK_BLOCK, which costs a sort
/// of a block and a fit of DRV_CLOCK_BLOCKS points. Stamps may wrap at any width; a pause of any length is bridged, the
/// host clock telling how often the stamp went round. The unwrapped stamp fits int64: 2^63 ticks.
///
/// What is fitted. Late: a host stamp is the time of the event plus a delay that is never below some least delay, as of
/// a bus, a USB poll or a scheduler; the line through the least delays is taken, so that a host that lags now and then
/// moves nothing. Symmetric: the host stamp scatters both ways about the truth; the line through the medians is taken.
/// A stamp stands for the begin of its tick in the first case, for the middle of it in the second.
#ifndef DRV_CLOCK_FIT_H
#define DRV_CLOCK_FIT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Pairs of a block, blocks that are kept.
enum { DRV_CLOCK_BLOCK = 256, DRV_CLOCK_BLOCKS = 64 };

/// How host stamps scatter: see above.
typedef enum drv_clock_jitter_t {
    DRV_CLOCK_LATE,     ///< never early
    DRV_CLOCK_SYMMETRIC ///< both ways
} drv_clock_jitter_t;

/// What is known of a device and its stamps.
typedef struct drv_clock_config_t {
    double tick_hz;            ///< ticks of the device clock a second, > 0
    int32_t stamp_bits;        ///< width of the stamp, 8..64; a round must take at least one second
    drv_clock_jitter_t jitter; ///< see above
    double jitter_s;           ///< typical jitter of the host stamp, 0 = 1 ms; twenty times it is an outlier
    double rate_ppm;           ///< how far the device clock may be off, 0 = 200
} drv_clock_config_t;

/// What drv_clock_fit_add() made of a pair.
typedef enum drv_clock_verdict_t {
    DRV_CLOCK_USED = 0,      ///< it went into the fit
    DRV_CLOCK_OUTLIER = 1,   ///< left out; when the next ones agree with it, it was one of the two below
    DRV_CLOCK_HOST_STEP = 2, ///< the host clock was set: the fit goes on from here with the rate it had
    DRV_CLOCK_RESTART = 3    ///< the device clock restarted: likewise
} drv_clock_verdict_t;

/// The clock of one device. Private but for its counts; lives where the caller puts it.
typedef struct drv_clock_fit_t {
    /// @cond private
    drv_clock_config_t config;
    int32_t started, block_target;
    int64_t host0_ns, device0; ///< origin; `device0` in ticks
    int64_t last_device;       ///< unwrapped ticks of the newest good pair
    double line, rate, since;  ///< host - device = line + rate (device - since), s, device time from the origin
    double variance[3];        ///< of line and rate: line, both, rate
    double rate_prior, rate_prior_sigma;
    double block[DRV_CLOCK_BLOCK], block_sum; ///< residuals of the block that fills; sum of their device times
    int32_t block_count;
    double block_first;
    double point_at[DRV_CLOCK_BLOCKS], point[DRV_CLOCK_BLOCKS]; ///< ring of finished blocks
    double growth_first, growth_second, growth;                 ///< of the low quantiles from doubling to doubling
    double scatter;                                             ///< of the points about the line, s
    int64_t points;
    // Pairs that do not fit, but perhaps fit each other.
    int32_t suspects, suspect_is_restart;
    double suspect, suspect_since_s; ///< how far off, and since when by the device
    int64_t suspect_device;
    /// @endcond
    uint64_t used;       ///< pairs in the fit
    uint64_t outliers;   ///< pairs left out
    uint64_t host_steps; ///< times the host clock was set
    uint64_t restarts;   ///< times the device clock restarted
} drv_clock_fit_t;

/// @return 0 or -EINVAL
int drv_clock_fit_init(drv_clock_fit_t* self, const drv_clock_config_t* config);

/// Take in a pair. @return DRV_CLOCK_…
drv_clock_verdict_t drv_clock_fit_add(drv_clock_fit_t* self, uint64_t stamp, int64_t host_ns);

/// Host time of a stamp near the newest pair (within half a round).
/// @param sigma_s  out, NULL = not wanted: σ of the line there. The least delay itself is not known and not in it.
/// @return 0, or -EAGAIN before the first block is full (32 pairs)
int drv_clock_fit_map(const drv_clock_fit_t* self, uint64_t stamp, int64_t* host_ns, double* sigma_s);

/// Parts in a million by which a second of the device clock is longer than one of the host. @return 0 or -EAGAIN
int drv_clock_fit_rate(const drv_clock_fit_t* self, double* ppm, double* sigma_ppm);

#ifdef __cplusplus
}
#endif
#endif
