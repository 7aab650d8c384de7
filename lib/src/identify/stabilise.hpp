// SPDX-License-Identifier: MIT
// PURPOSE    the smallest ridge that makes the ARX model stable
// REFERENCE  docs/numerics.md trap 22
#pragma once
#include <okid/types.h>

#include <cmath>

namespace okid {

/// Go down the half-decade grid ridge_min .. 1e11 ridge_min from its largest ridge while the model stays stable, and leave
/// the solver at the smallest such ridge. From above, because stability is not monotone in the ridge: below the last
/// unstable value lie islands where the radius is below 1 by chance and the model is poor.
/// @param stable  solves with the ridge it is given and says whether the ARX model is stable
template <class Stable> okid_status_t stabilise(double ridge_min, Stable stable) {
    constexpr int grid_size = 23; // 1e-12, 3e-12, .. 1e-1
    auto ridge = [&](int k) { return ridge_min * std::pow(10.0, 0.5 * k); };
    int k = grid_size - 1;
    while (k > 0 && stable(ridge(k))) --k;
    if (k == grid_size - 1) return OKID_ERR_UNSTABLE;
    return stable(ridge(k + 1)) ? OKID_OK : OKID_ERR_UNSTABLE;
}

} // namespace okid
