// SPDX-License-Identifier: MIT
// PURPOSE    model order from the singular values of the Hankel matrix, or from how modes hold over the orders
#pragma once
#include <okid/types.h>

namespace okid {

struct gap_choice {
    int order;    ///< even
    double ratio; ///< sigma_order / sigma_(order+1)
};
/// Ratios that decide by themselves: of the values of a Hankel matrix, of correlations of it (ERA/DC), of canonical
/// correlations (CVA, SSARX).
constexpr double least_gap_at_noise = 2.0; ///< of a Hankel matrix, where the gap stands at the noise level
constexpr double clear_gap = 10.0, clear_correlation_gap = 30.0, clear_canonical_gap = 2.5;

/// The largest gap over even orders up to `largest`.
gap_choice order_by_gap(const okid_real_t* values, int count, int largest);

/// What a set of modes is worth: sum of (2 EMAC - 1)^4 over EMAC > 0.5. A structural mode counts nearly 1, a chance 0.75
/// of a noise mode 0.06, so that many noise modes do not add up.
okid_real_t consistency_score(const okid_real_t* emac, int count);

/// scores[k] belongs to order 2 (k + 1), unstable models 0. The smallest order near the best score; 0 when none scores.
int order_by_score(const okid_real_t* scores, int count);

} // namespace okid
