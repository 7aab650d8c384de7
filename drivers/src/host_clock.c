// SPDX-License-Identifier: MIT
// PURPOSE  time stamps of a clock that is never set
// METHOD   CLOCK_REALTIME runs beside CLOCK_BOOTTIME but for the times it is set (slewing by NTP moves both alike): a pair
//          whose bracket does not hold the distance known is such a time
#include <drv/host_clock.h>

#include <stdatomic.h>
#include <time.h>

static const int64_t least_set_ns = 1000000; // by less than this the clock is not found set

static int64_t clock_ns(clockid_t which) {
    struct timespec now;
    clock_gettime(which, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

drv_clock_pair_t drv_clock_pair(int reference, int tries) {
    drv_clock_pair_t best = {0, 0, INT64_MAX};
    for (int i = 0; i < tries; ++i) {
        drv_clock_pair_t pair;
        pair.before_ns = clock_ns(CLOCK_BOOTTIME);
        pair.reference_ns = clock_ns(reference);
        pair.after_ns = clock_ns(CLOCK_BOOTTIME);
        if (pair.after_ns - pair.before_ns < best.after_ns - best.before_ns) best = pair;
    }
    return best;
}

enum { EXACT = 3 }; // tries for a distance that is kept

static int64_t middle(const drv_clock_pair_t* pair) {
    return pair->reference_ns - pair->before_ns - (pair->after_ns - pair->before_ns) / 2;
}

/// CLOCK_REALTIME - CLOCK_BOOTTIME as the program found it.
static int64_t origin_ns(void) {
    static _Atomic int64_t origin;
    int64_t known = atomic_load(&origin);
    if (known != 0) return known;
    const drv_clock_pair_t pair = drv_clock_pair(CLOCK_REALTIME, EXACT);
    const int64_t found = middle(&pair) ? middle(&pair) : 1;
    return atomic_compare_exchange_strong(&origin, &known, found) ? found : known;
}

int64_t drv_host_time_of(int64_t boottime_ns) { return boottime_ns + origin_ns(); }

int64_t drv_host_time_ns(void) { return drv_host_time_of(clock_ns(CLOCK_BOOTTIME)); }

/// The distance known is within what the pair says.
static int fits(const drv_host_clock_t* self, const drv_clock_pair_t* real) {
    return self->apart_ns >= real->reference_ns - real->after_ns - least_set_ns &&
           self->apart_ns <= real->reference_ns - real->before_ns + least_set_ns;
}

int drv_host_clock_look(drv_host_clock_t* self, const drv_clock_pair_t* real) {
    const int64_t most = real->reference_ns - real->before_ns, least = real->reference_ns - real->after_ns;
    self->now_ns = real->after_ns;
    if (!self->started) {
        self->started = 1;
        const int64_t origin = origin_ns();
        const int same = origin >= least - least_set_ns && origin <= most + least_set_ns;
        self->apart_ns = self->before_ns = same ? origin : middle(real); // stamps stay what they were until it is set
        self->last_ns = real->before_ns;
        return 0;
    }
    if (fits(self, real)) return 0;
    self->before_ns = self->apart_ns;
    self->apart_ns = middle(real);
    ++self->sets;
    return 1;
}

int drv_host_clock_look_now(drv_host_clock_t* self) {
    drv_clock_pair_t real = drv_clock_pair(CLOCK_REALTIME, 1);
    if (!self->started || !fits(self, &real)) real = drv_clock_pair(CLOCK_REALTIME, EXACT);
    return drv_host_clock_look(self, &real);
}

/// How far a moment lies outside of what is possible: not before the stamp carried last, not after now.
static int64_t impossible_by(const drv_host_clock_t* self, int64_t moment_ns) {
    if (moment_ns < self->last_ns) return self->last_ns - moment_ns;
    return moment_ns > self->now_ns ? moment_ns - self->now_ns : 0;
}

int64_t drv_host_clock_carry(drv_host_clock_t* self, int64_t stamp_ns) {
    const int64_t now = stamp_ns - self->apart_ns, before = stamp_ns - self->before_ns;
    const int64_t moment = impossible_by(self, before) < impossible_by(self, now) ? before : now;
    if (moment > self->last_ns && moment <= self->now_ns) self->last_ns = moment;
    return drv_host_time_of(moment);
}
