// SPDX-License-Identifier: MIT
// PURPOSE    how far counts may grow: what a kernel absorbs, and what two of them merge to, whatever a state from a file says
#ifndef OKID_COUNTS_H
#define OKID_COUNTS_H

#include <okid/accumulator.h>

/// Rows whose exact sums fit their words: of codes 63 bits, of doubles as many as are counted.
static inline int64_t row_limit(okid_sample_t sample) {
    switch (sample) {
    case OKID_SAMPLE_INT16: return INT64_C(1) << 48;
    case OKID_SAMPLE_INT24: return INT64_C(1) << 40;
    case OKID_SAMPLE_INT32: return INT64_C(1) << 32;
    default: return OKID_MOST_SAMPLES;
    }
}

static inline int count_fits(int64_t a, int64_t b) { return a <= OKID_MOST_SAMPLES - b; }

/// Of two that are not negative each: are there at most `rows` rows together, and of all else at most OKID_MOST_SAMPLES?
static inline int counts_fit(const okid_accumulator_stats_t* a, const okid_accumulator_stats_t* b, int64_t rows,
                             int64_t clock, int64_t other_clock) {
    return a->rows <= rows - b->rows && count_fits(a->samples, b->samples) && count_fits(a->missing, b->missing) &&
           count_fits(a->gaps, b->gaps) && count_fits(a->saturated, b->saturated) &&
           count_fits(a->dropped, b->dropped) && count_fits(clock, other_clock);
}

/// Of `count` missing samples those that are still counted.
static inline int64_t gap_within(int64_t count, int64_t clock) {
    const int64_t left = clock < OKID_MOST_SAMPLES ? OKID_MOST_SAMPLES - clock : 0;
    return count < left ? count : left;
}
#endif
