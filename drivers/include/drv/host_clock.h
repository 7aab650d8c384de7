// SPDX-License-Identifier: MIT
/// @file host_clock.h
/// Host time: CLOCK_REALTIME as it stood when this program first asked, carried on by CLOCK_BOOTTIME. Setting the clock
/// of the computer, by hand or by NTP, moves neither frames nor edges against each other; a suspended computer's sleep
/// counts. All time stamps of the drivers are of it.
#ifndef DRV_HOST_CLOCK_H
#define DRV_HOST_CLOCK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Two clocks read together: `reference_ns` was taken between two reads of CLOCK_BOOTTIME.
typedef struct drv_clock_pair_t {
    int64_t before_ns;    ///< CLOCK_BOOTTIME
    int64_t reference_ns; ///< the other clock
    int64_t after_ns;     ///< CLOCK_BOOTTIME again
} drv_clock_pair_t;

/// Read two clocks. @param reference  CLOCK_REALTIME, CLOCK_MONOTONIC, …; @param tries  the tightest of so many
drv_clock_pair_t drv_clock_pair(int reference, int tries);

/// Host time now. Any thread.
int64_t drv_host_time_ns(void);
/// Host time of a moment of CLOCK_BOOTTIME.
int64_t drv_host_time_of(int64_t boottime_ns);

/// Stamps of CLOCK_REALTIME, in the order of their queue, to host time. One object a source.
typedef struct drv_host_clock_t {
    /// @cond private
    int64_t apart_ns, before_ns; ///< CLOCK_REALTIME - CLOCK_BOOTTIME now, and before the clock was set last
    int64_t last_ns, now_ns;     ///< CLOCK_BOOTTIME of the newest stamp carried, and of the last look
    uint32_t sets;               ///< times the clock was found set
    int32_t started;
    /// @endcond
} drv_host_clock_t;

/// Just after frames were read, before their stamps are carried: was the clock set? @return 1 when it was
int drv_host_clock_look(drv_host_clock_t* self, const drv_clock_pair_t* real);
/// The same with the clocks of this computer, as they are now.
int drv_host_clock_look_now(drv_host_clock_t* self);

/// Host time of a stamp. When the clock was set while frames waited, a stamp of before is distinguished from one of after
/// by which is nearer to what is possible: not before the stamp carried last, and not after the last look.
int64_t drv_host_clock_carry(drv_host_clock_t* self, int64_t stamp_ns);

#ifdef __cplusplus
}
#endif
#endif
