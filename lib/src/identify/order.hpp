// SPDX-License-Identifier: MIT
// PURPOSE    model order from the singular values of the Hankel matrix, or from how modes hold over the orders
#pragma once
#include <okid/steps/era.h>
#include <okid/steps/subspace.h>
#include <okid/types.h>

#include <algorithm>
#include <cmath>

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

/// The block row, 0 .. last, at which EMAC compares: the last, or that where a mode of this |mu| has fallen to a fiftieth of
/// its amplitude. Beyond that nothing is left of it that noise does not hide.
inline int telling_row(double size, int last) {
    constexpr double decays = 4;
    return size < 1 ? std::min(last, std::max(1, static_cast<int>(-decays / std::log(size)))) : last;
}

/// EMAC as okid_subspace_emac() and okid_era_emac() give it.
/// @param while_it_lasts  at telling_row(), else at the end
okid_status_t subspace_emac(const okid_subspace_t* self, int32_t order, const okid_real_t* C, const okid_modes_t* modes,
                            okid_real_t* emac, bool while_it_lasts);
okid_status_t era_emac(const okid_era_t* self, int32_t order, const okid_modes_t* modes, okid_real_t* emac,
                       bool while_it_lasts);

/// scores[k] belongs to order 2 (k + 1), unstable models 0. The smallest order near the best score; 0 when none scores.
int order_by_score(const okid_real_t* scores, int count);

} // namespace okid
