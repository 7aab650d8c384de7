// SPDX-License-Identifier: MIT
// PURPOSE    model order from the singular values of the Hankel matrix
// METHOD     the largest ratio sigma_n / sigma_(n+1) over even n when it stands out; otherwise the values above the floor
// REFERENCE  docs/numerics.md, order
#include "identify/order.hpp"

#include <algorithm>

namespace okid {

int choose_order(const double* values, int count, int largest, bool& clear) {
    constexpr double gap = 4.0, floor_ratio = 1e-12;
    const int last = std::min(largest, count - 1) / 2 * 2;
    int best = 2;
    double best_ratio = 0;
    for (int n = 2; n <= last; n += 2) {
        if (!(values[n - 1] > floor_ratio * values[0])) break;
        const double ratio = values[n - 1] / std::max(values[n], 1e-300);
        if (ratio > best_ratio) {
            best_ratio = ratio;
            best = n;
        }
    }
    clear = best_ratio >= gap;
    return best;
}

} // namespace okid
