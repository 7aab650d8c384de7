// SPDX-License-Identifier: MIT
// PURPOSE    the singular values that errors of the observer alone give the Hankel matrix
#pragma once
#include <okid/steps/observer.h>

#include "linalg/arena.hpp"

namespace okid {

/// One draw of the error of theta over the root of the innovation covariance, from the factor that okid_observer_solve()
/// left in its work. @param draw  n_y x q, in: independent numbers of variance 1, out: the error
/// @param solve  solve_work(n_y) doubles
void observer_error(const okid_observer_config_t& config, void* work, double* draw, double* solve);

/// x (q x n_y) <- (V V^T + ridge)^-1 x with the same factor.
void observer_change(const okid_observer_config_t& config, void* work, double* x);

struct noise_work {
    double *draw, *solve;
    okid_real_t *plain, *error, *root;      ///< the draw; of theta, n_y x q; factor of the innovation covariance
    okid_real_t *feedback, *feedback_error; ///< of theta and its error, n_y x p n_y
    okid_real_t *stack, *changes;           ///< Y_(last-1) .. Y_0, zeros, one below the other; errors from Y_last on
    okid_real_t* markov;                    ///< errors of Y_0 .. Y_last
    okid_real_t *left, *right;              ///< singular vectors in the making

    void lay_out(const okid_observer_config_t& c, int rows, int last, arena& memory);
};

/// How errors of theta change the Markov parameters Y_0 .. Y_last, to first order: begin once, then w.error -> w.markov.
void begin_spread(const okid_observer_config_t& c, const okid_real_t* theta, const okid_real_t* markov, int last,
                  const noise_work& w);
void spread_error(const okid_observer_config_t& c, int last, const noise_work& w);

/// 1.5 times the root mean square of the largest singular value of the Hankel matrix (rows x rows blocks) of what the
/// variance of the least squares does to the Markov parameters, over a few draws with a fixed seed.
/// @param observer_work  of okid_observer_solve(); theta, innovation, markov (Y_0 .. Y_last) its results
double noise_level(const okid_observer_config_t& c, void* observer_work, const okid_real_t* theta,
                   const okid_real_t* innovation, const okid_real_t* markov, int rows, int last, const noise_work& w);

} // namespace okid
