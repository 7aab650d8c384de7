// SPDX-License-Identifier: MIT
// PURPOSE    counts of two kernels that become one: none may leave its range, whatever a state from a file says
// METHOD     compared before anything is added
// REFERENCE  OKID_MOST_SAMPLES in accumulator.h
// NUMERICS   none
// WORKSPACE  none
#ifndef OKID_COUNTS_PRIVATE_H
#define OKID_COUNTS_PRIVATE_H

#include <okid/accumulator.h>

static inline int count_fits(int64_t a, int64_t b) { return a <= OKID_MOST_SAMPLES - b; }

/// Of two that are not negative each: is every sum of them at most OKID_MOST_SAMPLES?
static inline int counts_fit(const okid_accumulator_stats_t* a, const okid_accumulator_stats_t* b, int64_t clock,
                             int64_t other_clock) {
    return count_fits(a->samples, b->samples) && count_fits(a->missing, b->missing) && count_fits(a->gaps, b->gaps) &&
           count_fits(a->saturated, b->saturated) && count_fits(a->rows, b->rows) &&
           count_fits(a->dropped, b->dropped) && count_fits(clock, other_clock);
}

/// Of `count` missing samples those that are still counted.
static inline int64_t gap_within(int64_t count, int64_t clock) {
    const int64_t left = clock < OKID_MOST_SAMPLES ? OKID_MOST_SAMPLES - clock : 0;
    return count < left ? count : left;
}

#endif
