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
#include <limits>

namespace okid::linalg {

/// `solve(y)` multiplies n numbers by the inverse; `work`: 2 n.
template <class Real, class Solve> Real condition_of_solve(int n, Real norm1, Real* work, Solve solve) {
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
        solve(y);
        const Real size = size_of();
        if (step > 0 && !(size > estimate)) break;
        estimate = size;
        for (int i = 0; i < n; ++i) y[i] = y[i] >= 0 ? 1 : -1;
        solve(y);
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
    solve(y);
    const Real found = norm1 * std::max(estimate, 2 * size_of() / static_cast<Real>(3 * n));
    constexpr double none = 1e300; // singular to working accuracy
    const auto most = static_cast<Real>(std::min<double>(none, std::numeric_limits<Real>::max()));
    return found < most ? found : most;
}

} // namespace okid::linalg
