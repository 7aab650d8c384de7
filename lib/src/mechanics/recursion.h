// SPDX-License-Identifier: MIT
// PURPOSE    what goes from sample to sample along a record: a model with its predictor, and the filters of its modes
#ifndef OKID_RECURSION_H
#define OKID_RECURSION_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { OKID_RECURSION_LANES = 8 };

/// `count` numbers, padded to whole vectors of every instruction set.
static inline size_t okid_recursion_padded(size_t count) {
    return (count + OKID_RECURSION_LANES - 1) / OKID_RECURSION_LANES * OKID_RECURSION_LANES;
}

/// [estimate of y; next x] = M [u; y; x], M column-major with ld = padded(n_y + n_z) rows.
typedef struct okid_follow_t {
    size_t n_u, n_y, n_z, ld;
    const double *simulator, *predictor; ///< no predictor: NULL, it predicts what is simulated
    double *simulated, *predicted;       ///< 2 ld each; the state in hand stands behind n_y numbers of the first half
    double* sums;   ///< 5 x n_y: squares left of y by simulation, by prediction; sum, squares, count of y
    double* errors; ///< what simulation leaves, n_y numbers a sample; may be NULL
} okid_follow_t;

/// All of `count` rows [u; y]; a y that is NaN counts in no sum and corrects no state. u must be finite.
typedef void okid_follow_fn(const okid_follow_t* self, const double* rows, size_t count);

/// z <- w z + drive u for `states` complex numbers (padded): re at state, im behind them; drive: states x n_u. sums ([u, re,
/// im] x m, ld n_u + 2 states) += what stands before each sample times its row [u; y].
typedef struct okid_filters_t {
    size_t n_u, m, states;
    size_t active; ///< of the states, padded; the others are zero and stay
    const double *w_re, *w_im, *drive;
    double *state, *sums;
} okid_filters_t;

typedef void okid_filters_fn(const okid_filters_t* self, const double* rows, size_t count);

typedef struct okid_recursion_t {
    okid_follow_fn* follow;
    okid_filters_fn* filters;
} okid_recursion_t;

/// The fastest this processor runs.
okid_recursion_t okid_recursion_pick(void);

#ifdef __cplusplus
}
#endif
#endif
