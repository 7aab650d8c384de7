// SPDX-License-Identifier: MIT
// PURPOSE    what a call of add() brings, for every kernel that takes samples: four kinds of numbers, which of them are usable
#ifndef OKID_SOURCE_H
#define OKID_SOURCE_H

#include "accumulator.h"

enum { SCAN = 256, SCAN_AHEAD = 16384 };

/// The largest code; the smallest is one further from zero.
static inline int32_t full_scale(okid_sample_t sample) {
    return sample == OKID_SAMPLE_INT16 ? INT16_MAX : sample == OKID_SAMPLE_INT24 ? (1 << 23) - 1 : INT32_MAX;
}

/// What a call brings: m numbers a sample of one of four kinds.
typedef enum source_kind_t { FROM_DOUBLE, FROM_FLOAT, FROM_INT16, FROM_INT32 } source_kind_t;
typedef struct source_t {
    source_kind_t kind;
    const void* at;
} source_t;

static inline size_t number_bytes(source_t s) { return s.kind == FROM_DOUBLE ? 8 : s.kind == FROM_INT16 ? 2 : 4; }

static inline source_t advance(source_t s, size_t numbers) {
    return (source_t){s.kind, (const char*)s.at + numbers * number_bytes(s)};
}

static inline void copy_in(source_t source, double* to, size_t numbers) {
    switch (source.kind) {
    case FROM_DOUBLE: memcpy(to, source.at, numbers * sizeof *to); break;
    case FROM_FLOAT:
        for (size_t i = 0; i < numbers; ++i) to[i] = (double)((const float*)source.at)[i];
        break;
    case FROM_INT16:
        for (size_t i = 0; i < numbers; ++i) acc_put_code(to + i, ((const int16_t*)source.at)[i]);
        break;
    default:
        for (size_t i = 0; i < numbers; ++i) acc_put_code(to + i, ((const int32_t*)source.at)[i]);
        break;
    }
}

/// Is every number finite, for codes: below full scale?
static inline int usable(okid_sample_t sample, source_t source, size_t numbers) {
    if (source.kind == FROM_DOUBLE || source.kind == FROM_FLOAT) {
        double sum = 0, sums[8] = {0}; // eight chains, so that additions do not wait for each other
        size_t first = 0;
        for (; source.kind == FROM_DOUBLE && first + 8 <= numbers; first += 8)
            for (size_t k = 0; k < 8; ++k) sums[k] += ((const double*)source.at)[first + k] * 0.0;
        for (size_t k = 0; k < 8; ++k) sum += sums[k];
        if (source.kind == FROM_DOUBLE)
            for (size_t i = first; i < numbers; ++i) sum += ((const double*)source.at)[i] * 0.0;
        else
            for (size_t i = 0; i < numbers; ++i) sum += (double)((const float*)source.at)[i] * 0.0;
        return sum == 0;
    }
    const int32_t top = full_scale(sample);
    size_t full = 0;
    if (source.kind == FROM_INT16)
        for (size_t i = 0; i < numbers; ++i)
            full += ((const int16_t*)source.at)[i] == top || ((const int16_t*)source.at)[i] == -top - 1;
    else
        for (size_t i = 0; i < numbers; ++i)
            full += ((const int32_t*)source.at)[i] == top || ((const int32_t*)source.at)[i] == -top - 1;
    return full == 0;
}

/// Samples from the first on that are usable, at most `most`: whole pieces as far as they go, then one by one.
static inline size_t usable_run(source_t source, okid_sample_t sample, size_t m, size_t most) {
    size_t run = 0;
    while (run < most) {
        const size_t piece = most - run < SCAN ? most - run : SCAN;
        if (!usable(sample, advance(source, run * m), piece * m)) break;
        run += piece;
    }
    while (run < most && usable(sample, advance(source, run * m), m)) ++run;
    return run;
}

/// Usable samples in a row, and whether the sample behind them is missing.
typedef struct piece_t {
    source_t source;
    size_t count;
    int missing_behind;
} piece_t;

/// Take the next piece off what is left of a call, with the missing sample behind it.
static inline piece_t next_piece(source_t* left, size_t* count, okid_sample_t sample, size_t m) {
    const size_t most = *count < SCAN_AHEAD ? *count : SCAN_AHEAD, run = usable_run(*left, sample, m, most);
    const piece_t piece = {*left, run, run < most};
    const size_t taken = run + (size_t)piece.missing_behind;
    *left = advance(*left, taken * m);
    *count -= taken;
    return piece;
}

/// Codes at full scale, and words that are no code of this width.
typedef struct codes_seen_t {
    int64_t saturated, outside;
} codes_seen_t;

static inline codes_seen_t look_at_codes(source_t source, okid_sample_t sample, size_t numbers) {
    const int32_t top = full_scale(sample), bottom = -top - 1;
    codes_seen_t seen = {0, 0};
    if (source.kind == FROM_INT16) {
        const int16_t* codes = (const int16_t*)source.at;
        for (size_t i = 0; i < numbers; ++i) seen.saturated += codes[i] == top || codes[i] == bottom;
        return seen;
    }
    const int32_t* codes = (const int32_t*)source.at;
    for (size_t i = 0; i < numbers; ++i) {
        seen.saturated += codes[i] == top || codes[i] == bottom;
        seen.outside += codes[i] > top || codes[i] < bottom;
    }
    return seen;
}

#endif
