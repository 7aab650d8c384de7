// SPDX-License-Identifier: MIT
// PURPOSE    model order from the singular values of the Hankel matrix, or from how modes hold over the orders
// METHOD     gap: largest ratio sigma_n / sigma_(n+1) over even n. A smaller gap is believed where it stands just at the
//            level of the observer's errors (noise_level.cpp). Where no gap stands out (real structures) every even order
//            is realised, between once and twice the number of values above that level where it is known, and scored by
//            the EMAC of its consistent modes; the smallest stable order that reaches nine tenths of the best score is taken
// REFERENCE  docs/numerics.md, order; EMAC: Pappa, Elliott, Schenk (1993)
// NUMERICS   a gap of 10 is below what white-noise simulations show (>= 14) and above what measured records show (<= 4).
//            Correlations square the signal's part and mix the noise with it: 72 and more, up to 17 inside the signal.
//            Canonical correlations are bounded by 1: 3.0 and more, up to 1.2 inside. Measured records have fewer values
//            above the observer's errors than modes that hold, or more (25 to 35 for plates and frames with 11 to 14):
//            that level alone decides nothing
#include "identify/order.hpp"

#include "linalg/linalg.hpp"

#include <algorithm>

namespace okid {

gap_choice order_by_gap(const okid_real_t* values, int count, int largest) {
    constexpr okid_real_t floor_ratio = linalg::limit_of<okid_real_t>(1e-13),
                          least = linalg::limit_of<okid_real_t>(1e-16);
    const int last = std::min(largest, count - 1) / 2 * 2;
    gap_choice best{std::min(2, largest), 0};
    for (int n = 2; n <= last; n += 2) {
        if (!(values[n - 1] > floor_ratio * values[0])) break;
        const double ratio = values[n - 1] / std::max(values[n], least * values[0]);
        if (ratio > best.ratio) best = gap_choice{n, ratio};
    }
    return best;
}

okid_real_t consistency_score(const okid_real_t* emac, int count) {
    okid_real_t score = 0;
    for (int k = 0; k < count; ++k) {
        const okid_real_t above = std::max(okid_real_t{0}, 2 * emac[k] - 1);
        score += above * above * above * above;
    }
    return score;
}

int order_by_score(const okid_real_t* scores, int count) {
    constexpr auto share = static_cast<okid_real_t>(0.9);
    const okid_real_t best = *std::max_element(scores, scores + count);
    if (!(best > 0)) return 0;
    for (int k = 0; k < count; ++k)
        if (scores[k] >= share * best) return 2 * (k + 1);
    return 0;
}

} // namespace okid
