// SPDX-License-Identifier: MIT
/// @file pacer.h
/// Absolute deadlines on CLOCK_MONOTONIC: a late one does not move those behind it, so there is no drift.
#ifndef DRV_PACER_H
#define DRV_PACER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// How late the deadlines were met.
typedef struct drv_pacer_t {
    int64_t begin_ns; ///< CLOCK_MONOTONIC of offset 0
    uint64_t count;   ///< deadlines waited for
    double mean_ns;   ///< late by, mean
    double square_ns; ///< sum of squared deviations from the mean
    int64_t worst_ns; ///< late by, at most
} drv_pacer_t;

/// Offset 0 is now + lead_ns. Also asks the kernel to wake this thread without slack (default 50 microseconds).
void drv_pacer_start(drv_pacer_t* self, int64_t lead_ns);

/// Sleep until begin + offset_ns. Wakes every 100 ms to ask `stop` (may be NULL).
/// @return 1 when the deadline has come, 0 when `stop` said so
int drv_pacer_wait(drv_pacer_t* self, int64_t offset_ns, int (*stop)(void*), void* context);

/// ns since offset 0, negative before it.
int64_t drv_pacer_now(const drv_pacer_t* self);

/// Standard deviation of the lateness, ns; 0 below two deadlines.
double drv_pacer_deviation(const drv_pacer_t* self);

#ifdef __cplusplus
}
#endif
#endif
