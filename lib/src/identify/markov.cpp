// SPDX-License-Identifier: MIT
// PURPOSE    system and observer-gain Markov parameters from observer Markov parameters
// METHOD     recursions (40) and (41); theta holds -Ybar^II (eq. 26), so the minus signs of the paper turn to plus
// REFERENCE  paper eq. (26), (40), (41)
// NUMERICS   stable exactly when the ARX companion matrix is (observer.cpp sees to that)
// WORKSPACE  none; 2 count p n_y^2 m flop
#include <okid/steps/observer.h>

#include "linalg/linalg.hpp"

#include <algorithm>

namespace {

using std::size_t;

/// target(n) = own(n) + sum_h theta^y_h target(n-h), blocks of n_y x width; block 0 of `target` has index `first`.
void add_feedback(int n_u, int n_y, int p, const okid_real_t* theta, okid_real_t* target, int width, int n, int first) {
    const size_t m = static_cast<size_t>(n_u) + static_cast<size_t>(n_y),
                 size = static_cast<size_t>(n_y) * static_cast<size_t>(width);
    okid_real_t* out = target + static_cast<size_t>(n - first) * size;
    for (int h = 1; h <= std::min(n - first, p); ++h) {
        const size_t column = static_cast<size_t>(n_u) + static_cast<size_t>(h - 1) * m + static_cast<size_t>(n_u);
        okid::linalg::multiply(false, false, n_y, width, n_y, 1, theta + column * static_cast<size_t>(n_y), n_y,
                               target + static_cast<size_t>(n - h - first) * size, n_y, 1, out, n_y);
    }
}

} // namespace

okid_status_t okid_markov_recursion(int32_t n_u, int32_t n_y, int32_t p, const okid_real_t* theta, int32_t count,
                                    okid_real_t* system, okid_real_t* gain) {
    if (theta == nullptr || system == nullptr) return OKID_ERR_NULL;
    if (n_u < 1 || n_y < 1 || p < 1 || count < 0) return OKID_ERR_DIM;
    const size_t ny = static_cast<size_t>(n_y), nu = static_cast<size_t>(n_u), m = nu + ny;
    std::copy(theta, theta + ny * nu, system); // Y_0 = D
    for (int n = 1; n <= count; ++n) {
        const okid_real_t* own = theta + (nu + static_cast<size_t>(n - 1) * m) * ny; // [Ybar^I_n, -Ybar^II_n]
        okid_real_t* y = system + static_cast<size_t>(n) * ny * nu;
        if (n <= p)
            std::copy(own, own + ny * nu, y);
        else
            std::fill(y, y + ny * nu, okid_real_t{0});
        add_feedback(n_u, n_y, p, theta, system, n_u, n, 0);
        if (gain == nullptr) continue;
        okid_real_t* y0 = gain + static_cast<size_t>(n - 1) * ny * ny;
        if (n <= p)
            std::transform(own + ny * nu, own + ny * m, y0, [](okid_real_t x) { return -x; });
        else
            std::fill(y0, y0 + ny * ny, okid_real_t{0});
        add_feedback(n_u, n_y, p, theta, gain, n_y, n, 1);
    }
    return OKID_OK;
}
