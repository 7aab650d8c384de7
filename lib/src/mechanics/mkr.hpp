// SPDX-License-Identifier: MIT
// PURPOSE    what mkr.cpp (the matrices) and mkr_checks.cpp (can they be believed) share
#pragma once
#include "poles.hpp"

#include <okid/mkr.h>

namespace okid {

struct mkr_work {
    okid::poles poles;
    int n_x;
    int* listed;    // admissible modes, ascending in frequency: index of the pole
    double* share;  // of each, its part in the variance
    int32_t* taken; // n_x, index into `listed`
    okid_real_t *M, *K, *R, *R_normal, *W_re, *W_im;
    okid_real_t *mobility, *closure;              // 2 Re W L W^T = M^-1 and 2 Re W W^T = 0
    okid_real_t *one, *two, *left, *right, *work; // spare
    okid_real_t *frequency, *damping, *lambda_re, *lambda_im, *strength, *mpc, *phase, *spread, *values, *balance;
};

/// a <- (a + a^T)/2
void symmetrise(int n, okid_real_t* a);

/// Normal-mode damping matrix, checks and notes of a result whose matrices stand in w.
void check_mkr(mkr_work& w, const okid_model_t& model, const okid_mkr_config_t& config, okid_mkr_t& result);

} // namespace okid
