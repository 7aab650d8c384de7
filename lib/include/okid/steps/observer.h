// SPDX-License-Identifier: MIT
/// @file steps/observer.h
/// OKID least squares (paper eq. 36-39): observer Markov parameters from the Gram matrix, from the triangular factor of
/// the rows, or from the shift-structured sums; then the Markov parameters of the system (eq. 40, 41).
#ifndef OKID_STEPS_OBSERVER_H
#define OKID_STEPS_OBSERVER_H

#include <okid/identify.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes, and what is done about an ill-conditioned or unstable solution.
typedef struct okid_observer_config_t {
    int32_t n_u;      ///< inputs, >= 1
    int32_t n_y;      ///< outputs, >= 1
    int32_t p;        ///< lags
    double ridge_min; ///< ridge on the unit-diagonal Gram, >= 0; 0 = 1e-12
    /// 0 = search the smallest ridge on a half-decade grid that makes the ARX model stable; 1 = leave it; 2 = theta and
    /// the innovation only, for a record like one already solved: radius, condition and excitation are not looked at (0);
    /// 3 = as 0, where a model of more than 64 states is unstable only if it grows over 64 samples (from a Gram matrix)
    int32_t unstable;
} okid_observer_config_t;

/// The smallest ridge that makes the ARX model stable.
static inline okid_observer_config_t okid_observer_defaults(int32_t n_u, int32_t n_y, int32_t p) {
    const okid_observer_config_t config = {n_u, n_y, p, 0, 0};
    return config;
}

/// Bytes of work okid_observer_solve() needs; 0 when the configuration is invalid.
OKID_API size_t okid_observer_memsize(const okid_observer_config_t* config);

/// Solve y_n = theta [u_n; v_(n-1); ..; v_(n-p)] in the least-squares sense.
/// Method: equilibrate to unit diagonal, ridge, Cholesky, one step of refinement, companion radius, ridge search.
/// The normal equations are solved in double in every build; theta is rounded to okid_real_t at the end.
/// @param gram        in, m(p+1) x m(p+1) column-major of okid_accumulator_gram()
/// @param rows        in, regression rows behind it
/// @param theta       out, n_y x q column-major: [D, Ybar_1 .. Ybar_p], each Ybar_h n_y x m = [Ybar^I_h, -Ybar^II_h]
/// @param innovation  out, n_y x n_y covariance of the residual, may be NULL
/// @param work        caller's block of okid_observer_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_INPUT, OKID_ERR_OUTPUT,
///         OKID_ERR_EXCITATION, OKID_ERR_NUMERIC, OKID_ERR_UNSTABLE
/// Cost q^3/3 + 2 q^2 n_y flop for each ridge tried.
OKID_NODISCARD OKID_API okid_status_t okid_observer_solve(const okid_observer_config_t* config, const double* gram,
                                                          int64_t rows, okid_real_t* theta, okid_real_t* innovation,
                                                          okid_observer_info_t* info, void* work, size_t bytes);

// ---- from the triangular factor of the rows (okid/steps/square_root.h)

/// Bytes of work okid_observer_solve_factor() needs; 0 when the configuration is invalid.
OKID_API size_t okid_observer_factor_memsize(const okid_observer_config_t* config);

/// okid_observer_solve() from the factor: the condition of the data is not squared. The ridge is never below eps^(3/2) of
/// the unit-diagonal Gram (3e-24 in double, 4e-11 in float), which rank-deficient, that is noise-free, data need; an
/// unstable ARX model gets the ridges of the same grid, from 1e-12 up.
/// Method: unit columns, sqrt(ridge) I stacked under the factor by the same Householder update, back substitution.
/// @param factor      in, n x n of okid_square_root_factor()
/// @param rows        in, regression rows behind it
/// @param theta       out, n_y x q column-major as of okid_observer_solve()
/// @param innovation  out, n_y x n_y covariance of the residual, may be NULL
/// @param info        out; condition and input_excitation are those of the Gram matrix, that is, squares
/// @param work        caller's block of okid_observer_factor_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_INPUT, OKID_ERR_OUTPUT,
///         OKID_ERR_EXCITATION, OKID_ERR_NUMERIC, OKID_ERR_UNSTABLE
/// Cost 2/3 q^3 + q^2 n_y flop for each ridge tried. Source: paper eq. (36)-(39) without V V^T.
OKID_NODISCARD OKID_API okid_status_t okid_observer_solve_factor(const okid_observer_config_t* config,
                                                                 const okid_real_t* factor, int64_t rows,
                                                                 okid_real_t* theta, okid_real_t* innovation,
                                                                 okid_observer_info_t* info, void* work, size_t bytes);

// ---- from the shift-structured sums of one unbroken run, without the Gram matrix: O(m q) memory instead of q^2

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
/// @param sums        in, of okid_accumulator_run(); `sum` is not read (may be NULL) with OKID_DETREND_NONE, `mean` never
/// @param theta       out, n_y x q column-major: [D, Ybar_1 .. Ybar_p], each Ybar_h n_y x m = [Ybar^I_h, -Ybar^II_h]
/// @param innovation  out, n_y x n_y covariance of the residual, may be NULL
/// @param work        caller's block of okid_structured_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_INPUT, OKID_ERR_OUTPUT,
///         OKID_ERR_EXCITATION, OKID_ERR_NUMERIC, OKID_ERR_UNSTABLE
/// Cost about (6 m + 14 n_y + 40) n^2 flop for each ridge tried, n = m(p+1): as the dense solver at p near 40, more below.
OKID_NODISCARD OKID_API okid_status_t okid_structured_solve(const okid_observer_config_t* config,
                                                            okid_detrend_t detrend, const okid_run_sums_t* sums,
                                                            okid_real_t* theta, okid_real_t* innovation,
                                                            okid_observer_info_t* info, void* work, size_t bytes);

/// What leaving out each of some parts of the run does to theta, to first order: -(sum over its rows of e v^T) (V V^T)^-1,
/// e = y - theta v. The squares of what follows from the changes add up to a variance: times 1 / (1 - sum of W^2), W the
/// shares of the parts in the rows, when the parts make up the run.
/// @param whole   in, of the run, as okid_structured_solve() takes it, about the same constant as the parts: of
///                okid_accumulator_run() with OKID_DETREND_NONE
/// @param ridge   in, of okid_observer_info_t
/// @param theta   in, n_y x q of okid_structured_solve()
/// @param parts   in, count of them: S and sum over their rows, head before their first and tail at their last row
/// @param change  out, n_y x q column-major for each part
/// @param work    caller's block of okid_structured_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_NUMERIC
/// Cost (6 m + 20) n^2 flop, and 10 n^2 n_y for each part. Source: infinitesimal jackknife, Efron (1982).
OKID_NODISCARD OKID_API okid_status_t okid_structured_leave_out(const okid_observer_config_t* config,
                                                                okid_detrend_t detrend, const okid_run_sums_t* whole,
                                                                double ridge, const okid_real_t* theta,
                                                                const okid_run_sums_t* parts, int32_t count,
                                                                okid_real_t* change, void* work, size_t bytes);

// ---- what follows from the observer: the Markov parameters of the system and of the gain (eq. 40, 41)

/// The recursions (40) and (41), with the minus sign of eq. 26 applied.
/// @param theta   in, n_y x q column-major of okid_observer_solve()
/// @param count   in, >= 0: Y_0 .. Y_count and Y0_1 .. Y0_count are made
/// @param system  out, count+1 blocks of n_y x n_u, column-major, one after the other
/// @param gain    out, count blocks of n_y x n_y (Y0_1 first), may be NULL. Y0_k = C A^(k-1) L with L = -K (trap 3)
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM. Cost 2 count p n_y^2 m flop.
OKID_NODISCARD OKID_API okid_status_t okid_markov_recursion(int32_t n_u, int32_t n_y, int32_t p,
                                                            const okid_real_t* theta, int32_t count,
                                                            okid_real_t* system, okid_real_t* gain);

#ifdef __cplusplus
}
#endif
#endif
