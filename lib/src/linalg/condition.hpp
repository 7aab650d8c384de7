// SPDX-License-Identifier: MIT
// PURPOSE    condition of a symmetric matrix from its Cholesky factor, one for both backends
// METHOD     1-norm estimate of the inverse by its products with a few vectors (symmetric, so one solve each), and one with
//            alternating signs
// REFERENCE  Hager (1984); Higham, Accuracy and Stability (2002) 15.3
// NUMERICS   a lower bound, nearly always within 3
// WORKSPACE  2 n numbers; 2 n^2 flop a vector, at most 11
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace okid::linalg {

/// x <- (L L^T)^-1 x, both times down the columns of L.
template <class Real> void solve_vector(int n, const Real* l, int ldl, Real* x) {
    constexpr int lanes = 8;
    const auto column = [&](int c) { return l + static_cast<std::size_t>(c) * static_cast<std::size_t>(ldl); };
    for (int c = 0; c < n; ++c) {
        const Real* from = column(c);
        const Real value = x[c] /= from[c];
        for (int r = c + 1; r < n; ++r) x[r] -= from[r] * value;
    }
    for (int c = n - 1; c >= 0; --c) {
        const Real* from = column(c);
        Real sums[lanes] = {}, sum = x[c];
        int r = c + 1;
        for (; r + lanes <= n; r += lanes)
            for (int k = 0; k < lanes; ++k) sums[k] += from[r + k] * x[r + k];
        for (; r < n; ++r) sum -= from[r] * x[r];
        for (const Real part : sums) sum -= part;
        x[c] = sum / from[c];
    }
}

template <class Real> Real condition_of_factor(int n, const Real* l, int ldl, Real norm1, Real* work) {
    Real *x = work, *y = work + n;
    const auto size_of = [&] {
        Real sum = 0;
        for (int i = 0; i < n; ++i) sum += std::abs(y[i]);
        return sum;
    };
    std::fill(x, x + n, 1 / static_cast<Real>(n));
    Real estimate = 0;
    for (int step = 0; step < 5; ++step) {
        std::copy(x, x + n, y);
        solve_vector(n, l, ldl, y);
        const Real size = size_of();
        if (step > 0 && !(size > estimate)) break;
        estimate = size;
        for (int i = 0; i < n; ++i) y[i] = y[i] >= 0 ? 1 : -1;
        solve_vector(n, l, ldl, y);
        int best = 0;
        Real along = 0;
        for (int i = 0; i < n; ++i) {
            along += y[i] * x[i];
            if (std::abs(y[i]) > std::abs(y[best])) best = i;
        }
        if (std::abs(y[best]) <= along) break;
        std::fill(x, x + n, Real(0));
        x[best] = 1;
    }
    for (int i = 0; i < n; ++i)
        y[i] = (i % 2 == 0 ? 1 : -1) * (1 + static_cast<Real>(i) / static_cast<Real>(std::max(n - 1, 1)));
    solve_vector(n, l, ldl, y);
    const Real found = norm1 * std::max(estimate, 2 * size_of() / static_cast<Real>(3 * n));
    constexpr double none = 1e300; // singular to working accuracy
    const auto most = static_cast<Real>(std::min<double>(none, std::numeric_limits<Real>::max()));
    return found < most ? found : most;
}

} // namespace okid::linalg
