// SPDX-License-Identifier: MIT
/// @file structured.h
/// OKID least squares (paper eq. 36-39) from the shift-structured sums themselves, without the Gram matrix: O(m q) memory
/// where okid_observer_solve() needs q^2. For one unbroken run of samples.
#ifndef OKID_STRUCTURED_H
#define OKID_STRUCTURED_H

#include <okid/observer.h>
#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bytes of the work block with the Eigen backend, for static arrays: never less than okid_structured_memsize(), and at
/// most 1.2 KiB more.
#define OKID_STRUCTURED_BYTES(n_u, n_y, p)                                                                             \
    (8 * OKID_STRUCTURED_SUMS_((size_t)(n_u) + (n_y), (size_t)(p)) + 1088 +                                            \
     (OKID_STRUCTURED_SOLVER_((size_t)(n_u) + (n_y), (size_t)(n_y), (size_t)(p)) >                                     \
              OKID_STRUCTURED_RADIUS_((size_t)(n_y), (size_t)(p))                                                      \
          ? OKID_STRUCTURED_SOLVER_((size_t)(n_u) + (n_y), (size_t)(n_y), (size_t)(p))                                 \
          : OKID_STRUCTURED_RADIUS_((size_t)(n_y), (size_t)(p))))
/// @cond
#define OKID_STRUCTURED_SUMS_(m, p) ((m) * ((p) + 3))
#define OKID_STRUCTURED_SOLVER_(m, n_y, p)                                                                             \
    (8 * (2 * ((m) + 2) * (m) * ((p) + 2) + ((m) + 2) + (m) * (m) + (n_y) * (n_y) +                                    \
          ((n_y) < 4 ? (n_y) : 4) * (3 * (m) * ((p) + 1) + 2 * ((m) + 2) + (n_y))))
#define OKID_STRUCTURED_RADIUS_(n_y, p)                                                                                \
    (sizeof(okid_real_t) *                                                                                             \
     ((n_y) * (n_y) * (p) + ((n_y) * (p) > 64 ? 65 * (n_y) * (p) + 12608 : (n_y) * (p) * ((n_y) * (p) + 5))))
/// @endcond

/// Bytes of the work block, 0 when config is NULL or a size is below 1. With n = m(p+1) the larger of two parts beside
/// n + 2 m doubles: the solver, 2 (m+2)(n+m) + 3 min(4, n_y) n + O(m^2) doubles, and the companion radius after it, of
/// k = p n_y states: k^2 + p n_y^2 + 5 k doubles up to k = 64, 65 k + p n_y^2 + O(64^2) beyond.
OKID_API size_t okid_structured_memsize(const okid_observer_config_t* config);

/// Solve y_n = theta [u_n; v_(n-1); ..; v_(n-p)] in the least-squares sense: the problem, the ridge rule, the numbers in
/// info and the errors of okid_observer_solve(), with the Gram matrix factored through its displacement.
/// Differences: one scale for all lags of a channel (not one a row), two steps of refinement, input_excitation from pivots
/// in lag order, condition estimated (1-norm) through the structured inverse.
/// Double in every build; theta is rounded at the end. An offset far above the rms costs the digits it has in S: give sums
/// of samples less a constant, as okid_accumulator_run() does.
/// @param detrend     OKID_DETREND_MEAN centres each lag row by its own mean, exactly
/// @param S           in, m x m(p+1) column-major: S_0 .. S_p side by side, S_b(r, c) = sum over rows of v_n[r] v_(n-b)[c]
/// @param head        in, m x p: column a is v_(f-1-a), f the first regression row
/// @param tail        in, m x p: column a is v_(l-a), l the last regression row
/// @param sum         in, m numbers: sum over rows of v_n; not read (may be NULL) with OKID_DETREND_NONE
/// @param rows        in, regression rows behind the sums
/// @param theta       out, n_y x q column-major: [D, Ybar_1 .. Ybar_p], each Ybar_h n_y x m = [Ybar^I_h, -Ybar^II_h]
/// @param innovation  out, n_y x n_y covariance of the residual, may be NULL
/// @param work        caller's block of okid_structured_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_INPUT, OKID_ERR_OUTPUT,
///         OKID_ERR_EXCITATION, OKID_ERR_NUMERIC, OKID_ERR_UNSTABLE
/// Cost about (6 m + 14 n_y + 40) n^2 flop for each ridge tried, n = m(p+1): as the dense solver at p near 40, more below.
OKID_NODISCARD OKID_API okid_status_t okid_structured_solve(const okid_observer_config_t* config,
                                                            okid_detrend_t detrend, const double* S, const double* head,
                                                            const double* tail, const double* sum, int64_t rows,
                                                            okid_real_t* theta, okid_real_t* innovation,
                                                            okid_observer_info_t* info, void* work, size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
