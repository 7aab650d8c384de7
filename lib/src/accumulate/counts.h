// SPDX-License-Identifier: MIT
// PURPOSE    how far counts may grow: what a kernel absorbs, and what two of them merge to
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

/// Do the counts of both, together, stay within `rows` rows and OKID_MOST_SAMPLES samples, the missing ones included?
static inline int counts_fit(const okid_accumulator_stats_t* a, const okid_accumulator_stats_t* b, int64_t rows) {
    const int64_t most = OKID_MOST_SAMPLES; // each of the four is at most this, so that no difference overflows
    return a->rows <= rows - b->rows && a->samples <= most - b->samples &&
           a->samples + b->samples <= most - a->missing && a->samples + b->samples + a->missing <= most - b->missing;
}
#endif
