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

enum { OKID_FILTERS_BLOCK = 8, OKID_FILTERS_STRETCH = 16 * OKID_FILTERS_BLOCK };

/// z(t+1) = w z(t) + u(t) of `modes` numbers w for every input, and w^t, times the rows [u; y] of their time. K and M: modes
/// and m, padded to whole vectors (okid_filters_padded). Of a block from t0 on, z(t0 + j) = w^j z(t0) + what its own inputs
/// add: the sum over t of z(t) v(t) is `sums` + that over d of w^(d-1) `lags` d.
typedef struct okid_filters_t {
    size_t n_u, m, modes;
    size_t lasting;       ///< modes, from the first on, whose w^t is in the sums
    const double* powers; ///< of four modes after four: w^0 .. w^BLOCK, each four real and four imaginary parts
    double* state;        ///< of every input, then w^t: K real and K imaginary parts
    double* sums;         ///< (n_u + 1) x modes x 2 x M: z(t0) times the sum over j of w^j v(t0 + j)
    double* lags;         ///< n_u x BLOCK x M: u(s) v(s + d) of the pairs within blocks, d = 0 ..
    double* work;         ///< okid_filters_work() numbers
} okid_filters_t;

static inline size_t okid_filters_padded(size_t count) { return (count + 3) / 4 * 4; }
static inline size_t okid_filters_work(size_t n_u, size_t modes) {
    const size_t blocks = OKID_FILTERS_STRETCH / OKID_FILTERS_BLOCK;
    return OKID_FILTERS_STRETCH * (n_u + 4) + 2 * (blocks + 1) * (n_u + 1) * okid_filters_padded(modes) +
           8 * blocks * modes;
}
/// Where the real part of w^j of a mode stands among the powers; the imaginary one four behind it.
static inline size_t okid_filters_power(size_t mode, size_t j) {
    return 8 * (mode / 4 * (OKID_FILTERS_BLOCK + 1) + j) + mode % 4;
}

/// Adds `count` rows: OKID_FILTERS_STRETCH, the last time fewer.
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
