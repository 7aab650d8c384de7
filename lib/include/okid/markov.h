// SPDX-License-Identifier: MIT
/// @file markov.h
/// System and observer-gain Markov parameters from observer Markov parameters (paper eq. 40, 41).
#ifndef OKID_MARKOV_H
#define OKID_MARKOV_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

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
