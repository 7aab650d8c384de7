// SPDX-License-Identifier: MIT
/// @file pdc.h
/// Proportional damping coefficients: R = alpha M + beta K from frequencies and damping ratios (paper eq. 124-131).
#ifndef OKID_PDC_H
#define OKID_PDC_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// R = alpha M + beta K, and how well that fits.
typedef struct okid_pdc_t {
    okid_real_t alpha; ///< 1/s, of M
    okid_real_t beta;  ///< s, of K
    okid_real_t
        residual; ///< |zeta - fit| / |zeta| (weighted Euclidean norms): how far the damping is from proportional
    okid_real_t condition; ///< of the two columns after scaling; above 1e3 alpha and beta cannot be told apart
} okid_pdc_t;

/// Least squares of zeta_k = alpha/(2 w_k) + beta w_k/2 over the modes (eq. 125-130). O(count) flop.
/// One mode, or modes of one frequency, fix only the sum: then the solution of least scaled norm is returned, which
/// splits the damping evenly; R is right all the same for those modes.
/// @param count          modes, >= 1
/// @param frequency_hz   in, count, > 0; @param damping_ratio  in, count
/// @param weight         in, count, >= 0 and not all 0 (1/variance of the damping ratio), or NULL (all 1)
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (also for a frequency that is not positive, a weight that is negative
///         or a value that is not finite)
OKID_NODISCARD OKID_API okid_status_t okid_pdc_fit(int32_t count, const okid_real_t* frequency_hz,
                                                   const okid_real_t* damping_ratio, const okid_real_t* weight,
                                                   okid_pdc_t* pdc);

/// R = alpha M + beta K (eq. 131). @param M, K  in, n_x x n_x; @param R  out, n_x x n_x
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM
OKID_NODISCARD OKID_API okid_status_t okid_pdc_damping(int32_t n_x, const okid_pdc_t* pdc, const okid_real_t* M,
                                                       const okid_real_t* K, okid_real_t* R);

#ifdef __cplusplus
}
#endif
#endif
