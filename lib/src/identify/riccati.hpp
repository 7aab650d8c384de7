// SPDX-License-Identifier: MIT
// PURPOSE    Kalman gain of a model from the residuals of its state equations
#pragma once
#include <cstddef>

namespace okid {

struct residual_model {
    int n, n_y, width; ///< states, outputs, columns of the residuals
    const double* A;   ///< n x n
    const double* C;   ///< n_y x n
    double* W;         ///< n x width, x_(k+1) - A x_k - B u_k; destroyed
    const double* V;   ///< n_y x width, y_k - C x_k - D u_k
};

/// Doubles of work.
std::size_t kalman_work(int n, int n_y);

/// K (n x n_y) and Re (n_y x n_y), the covariance of the innovations times the rows behind W and V.
/// @return false when the iteration does not converge
bool kalman_gain(const residual_model& model, double* K, double* Re, double* work);

} // namespace okid
