// SPDX-License-Identifier: MIT
// PURPOSE    the subspace methods' part of the one call
// METHOD     Gram matrix or factor -> weighted projection; Markov parameters by the recursion C A^k B
// REFERENCE  paper eq. (55)-(95)
// NUMERICS   see subspace.cpp. The condition is that of the unit-diagonal Gram matrix of all 2 i m rows, from the factor
//            that the decomposition made (with its ridge of 1e-13: no more than some 1e13 times n); from a factor of the
//            rows the ratio of its pivots, squared
// WORKSPACE  the subspace's own
#include "identify/identify.hpp"

#include "identify/subspace.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace okid {
namespace {

constexpr double no_pivot = 1e16;        // condition of what rounding has made singular
constexpr double rounding_ridge = 1e-12; // more than this is needed only by what rounding has made indefinite

double factor_condition(const okid_identify& s) {
    const auto* factor = reinterpret_cast<const okid_real_t*>(s.gram);
    double least = 1;
    for (int c = 0; c < s.n; ++c) {
        const okid_real_t* column = factor + area(c, s.n);
        double sum = 0;
        for (int r = 0; r <= c; ++r) sum += static_cast<double>(column[r]) * static_cast<double>(column[r]);
        least = std::min(least, std::abs(static_cast<double>(column[c])) / std::sqrt(sum));
    }
    return least * least > 1 / no_pivot ? 1 / (least * least) : no_pivot;
}

/// What the decomposition found, as notes on the result.
void note(const okid_identify& s, const okid_subspace_info_t& info, double condition, okid_identified_t* out) {
    okid_observer_info_t& about = out->observer_info;
    about.ridge = info.ridge;
    about.condition = condition;
    about.input_excitation = info.input_excitation;
    if (condition > 1e10) out->warnings |= OKID_NOTE_ILL_CONDITIONED;
    if (out->regression_rows < 10LL * s.q) out->warnings |= OKID_NOTE_FEW_ROWS;
    if (s.n_u > 0 && info.input_excitation < 1e-8) out->warnings |= OKID_NOTE_WEAK_EXCITATION;
}

} // namespace

okid_status_t decompose_subspace_gram(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (out->regression_rows < s.n) return OKID_ERR_TOO_SHORT;
    okid_status_t status = okid_accumulator_gram(accumulator, s.config.detrend, s.gram, s.mean);
    if (status == OKID_OK) status = check_constant_gram(s, s.n, out);
    if (status != OKID_OK) return status;
    okid_subspace_info_t info;
    expect(s.subspace, s.poles_only ? 0 : s.follow > 0 ? s.follow : s.config.order, s.follow == 0);
    status = okid_subspace_decompose(s.subspace, s.gram, out->regression_rows, &info);
    out->observer_info.channel = info.channel;
    if (status != OKID_OK) return status;
    const double condition = info.ridge > rounding_ridge ? no_pivot : condition_of(s.subspace);
    note(s, info, s.follow > 0 ? 0 : condition, out);
    return status;
}

okid_status_t decompose_subspace_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out) {
    if (out->regression_rows < s.n) return OKID_ERR_TOO_SHORT;
    auto* factor = reinterpret_cast<okid_real_t*>(s.gram);
    okid_status_t status = okid_square_root_factor(square_root, s.config.detrend, factor, s.mean);
    if (status == OKID_OK) status = check_constant_factor(s, out);
    if (status != OKID_OK) return status;
    okid_subspace_info_t info;
    expect(s.subspace, s.config.order, false);
    status = okid_subspace_decompose_factor(s.subspace, factor, out->regression_rows, &info);
    out->observer_info.channel = info.channel;
    if (status == OKID_OK) note(s, info, factor_condition(s), out);
    return status;
}

void model_markov(const okid_identify& s, int order) {
    if (s.n_u == 0) return;
    const size_t block = area(s.n_y, s.n_u), size = area(order, s.n_u);
    okid_real_t *power = s.powers, *next = s.powers + size;
    std::copy(s.D, s.D + block, s.markov);
    std::copy(s.B, s.B + size, power);
    for (int k = 1; k <= s.markov_last; ++k) {
        linalg::multiply(false, false, s.n_y, s.n_u, order, 1, s.C, s.n_y, power, order, 0,
                         s.markov + static_cast<size_t>(k) * block, s.n_y);
        linalg::multiply(false, false, order, s.n_u, order, 1, s.A, order, power, order, 0, next, order);
        std::swap(power, next);
    }
}

} // namespace okid
