// SPDX-License-Identifier: MIT
// PURPOSE  frames at absolute times: SYNC, triggers, replayed logs
// METHOD   clock_nanosleep to an absolute CLOCK_MONOTONIC time; lateness by Welford's running mean and variance
#include <drv/pacer.h>

#include <math.h>
#include <string.h>
#include <time.h>

#include <sys/prctl.h>

enum { PIECE_NS = 100000000 };

static int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

void drv_pacer_start(drv_pacer_t* self, int64_t lead_ns) {
    memset(self, 0, sizeof *self);
    (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
    self->begin_ns = monotonic_ns() + lead_ns;
}

int64_t drv_pacer_now(const drv_pacer_t* self) { return monotonic_ns() - self->begin_ns; }

int drv_pacer_wait(drv_pacer_t* self, int64_t offset_ns, int (*stop)(void*), void* context) {
    const int64_t due = self->begin_ns + offset_ns;
    int64_t now = monotonic_ns();
    while (now < due) {
        if (stop && stop(context)) return 0;
        const int64_t until = due - now > PIECE_NS ? now + PIECE_NS : due;
        const struct timespec wake = {(time_t)(until / 1000000000), (long)(until % 1000000000)};
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, NULL); // a signal ends it early: asked again
        now = monotonic_ns();
    }
    if (stop && stop(context)) return 0;
    const int64_t late = now - due;
    const double step = (double)late - self->mean_ns;
    ++self->count;
    self->mean_ns += step / (double)self->count;
    self->square_ns += step * ((double)late - self->mean_ns);
    if (late > self->worst_ns) self->worst_ns = late;
    return 1;
}

double drv_pacer_deviation(const drv_pacer_t* self) {
    return self->count < 2 ? 0.0 : sqrt(self->square_ns / (double)(self->count - 1));
}
