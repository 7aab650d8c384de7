// SPDX-License-Identifier: MIT
/// @file observer.h
/// OKID least squares: observer Markov parameters from the Gram matrix (paper eq. 36-39).
#ifndef OKID_OBSERVER_H
#define OKID_OBSERVER_H

#include <okid/types.h>

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
    /// the innovation only, for a record like one already solved: radius, condition and excitation are not looked at (0)
    int32_t unstable;
} okid_observer_config_t;

/// What the solve found, beside the parameters.
typedef struct okid_observer_info_t {
    double ridge;  ///< ridge used, relative to the unit-diagonal Gram
    double radius; ///< spectral radius of the ARX companion matrix with that ridge; beyond 64 states its growth over 64
                   ///< samples where that is above 1.0005: a response that first grows marks a poor model too
    double radius_plain;     ///< the same with ridge_min: >= 1 means the plain least squares is unstable (trap 22)
    double condition;        ///< estimate (1-norm) of the condition of the equilibrated, ridged Gram
    double input_excitation; ///< smallest over largest pivot of the equilibrated Gram of the input lags; near 0 = poor
    int32_t channel;         ///< the channel an error speaks of, else -1
} okid_observer_info_t;

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

#ifdef __cplusplus
}
#endif
#endif
