// SPDX-License-Identifier: MIT
// PURPOSE    OKID's part of the one call: from sums to the decomposition of the Hankel matrix
// METHOD     Gram matrix, sums of one run or factor -> observer -> Markov parameters -> ERA or ERA/DC; see the modules
// REFERENCE  paper eq. (36)-(54)
// NUMERICS   see observer.cpp, era.cpp
// WORKSPACE  the modules' own
#include "identify/identify.hpp"

#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>

#include <algorithm>
#include <cmath>

using std::size_t;

namespace okid {
namespace {

/// A constant channel, judged by its variance about its own mean; -1 when there is none.
/// @param square  channel -> sum of its squares, less its mean when that is removed
template <class Square> int constant_channel(const okid_identify& s, double rows, Square square) {
    for (int c = 0; c < s.m; ++c) {
        const double own = square(static_cast<size_t>(c)), bias = rows * s.mean[c] * s.mean[c];
        const double variance = s.config.detrend == OKID_DETREND_MEAN ? own : own - bias;
        if (!(variance > 1e-13 * (std::abs(variance) + bias))) return c;
    }
    return -1;
}

okid_status_t constant_status(const okid_identify& s, okid_identified_t* out, int channel) {
    out->observer_info.channel = channel;
    return channel < 0 ? OKID_OK : channel < s.n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
}

/// theta from the Gram matrix.
okid_status_t observe_dense(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    okid_status_t status = okid_accumulator_gram(accumulator, s.config.detrend, s.gram, s.mean);
    if (status != OKID_OK) return status;
    const int64_t rows = out->regression_rows;
    status = check_constant_gram(s, s.n, out);
    if (status != OKID_OK) return status;
    okid_observer_config_t config = s.observer_config;
    if (s.poles_only) config.unstable = 3;
    return okid_observer_solve(&config, s.gram, rows, s.theta, s.innovation, &out->observer_info, s.observer_work,
                               s.observer_bytes);
}

/// theta from the sums of one run.
okid_status_t observe_structured(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    okid_run_sums_t sums{s.gram, s.head, s.tail, s.sum, s.mean, 0};
    okid_status_t status = okid_accumulator_run(accumulator, s.config.detrend, &sums);
    if (status != OKID_OK) return status;
    status = check_constant_gram(s, s.m, out);
    if (status != OKID_OK) return status;
    return okid_structured_solve(&s.observer_config, s.config.detrend, &sums, s.theta, s.innovation,
                                 &out->observer_info, s.observer_work, s.observer_bytes);
}

/// theta from the triangular factor, columns [u_n, v_(n-1), .., y_n].
okid_status_t observe_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out) {
    auto* factor = reinterpret_cast<okid_real_t*>(s.gram);
    okid_status_t status = okid_square_root_factor(square_root, s.config.detrend, factor, s.mean);
    if (status != OKID_OK) return status;
    const int64_t rows = out->regression_rows;
    status = check_constant_factor(s, out);
    if (status != OKID_OK) return status;
    return okid_observer_solve_factor(&s.observer_config, factor, rows, s.theta, s.innovation, &out->observer_info,
                                      s.observer_work, s.observer_bytes);
}

void observer_notes(okid_identified_t* out, int q) {
    const okid_observer_info_t& info = out->observer_info;
    if (info.radius_plain >= 1) out->warnings |= OKID_NOTE_ARX_STABILISED;
    if (info.condition > 1e10) out->warnings |= OKID_NOTE_ILL_CONDITIONED;
    if (out->regression_rows < 10LL * q) out->warnings |= OKID_NOTE_FEW_ROWS;
    if (info.input_excitation < 1e-8) out->warnings |= OKID_NOTE_WEAK_EXCITATION;
}

/// From theta to the singular values.
okid_status_t decompose_theta(okid_identify& s, okid_identified_t* out) {
    observer_notes(out, s.q);
    const okid_status_t status = okid_markov_recursion(s.n_u, s.n_y, s.config.p, s.theta, s.markov_last, s.markov,
                                                       s.follow > 0 && s.followed != nullptr ? nullptr : s.gain);
    if (status != OKID_OK) return status;
    std::copy(s.markov, s.markov + s.n_y * s.n_u, s.D);
    if (s.config.hankel == OKID_HANKEL_LITERAL) out->warnings |= OKID_NOTE_LITERAL_HANKEL;
    if (s.follow > 0 && s.followed != nullptr) return OKID_OK;
    return s.poles_only ? decompose_leading(s.era, hankel_blocks(s), s.max_order, s.config.p)
                        : okid_era_decompose(s.era, hankel_blocks(s));
}

} // namespace

okid_status_t check_constant_gram(const okid_identify& s, int stride, okid_identified_t* out) {
    const auto rows = static_cast<double>(out->regression_rows);
    return constant_status(
        s, out, constant_channel(s, rows, [&](size_t c) { return s.gram[c * static_cast<size_t>(stride + 1)]; }));
}

okid_status_t check_constant_factor(const okid_identify& s, okid_identified_t* out) {
    const auto* factor = reinterpret_cast<const okid_real_t*>(s.gram);
    const auto rows = static_cast<double>(out->regression_rows);
    return constant_status(s, out, constant_channel(s, rows, [&](size_t c) {
                               const size_t column =
                                   c < static_cast<size_t>(s.n_u) ? c : c + static_cast<size_t>(s.n - s.m);
                               double sum = 0;
                               for (size_t i = 0; i <= column; ++i) {
                                   const double r = factor[column * static_cast<size_t>(s.n) + i];
                                   sum += r * r;
                               }
                               return sum;
                           }));
}

okid_status_t decompose_observer_gram(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (out->regression_rows < s.q) return OKID_ERR_TOO_SHORT;
    const bool structured = s.config.solver == OKID_SOLVER_STRUCTURED;
    const okid_status_t status =
        structured ? observe_structured(s, accumulator, out) : observe_dense(s, accumulator, out);
    if (status != OKID_OK) return status;
    weigh_by_gram(s, structured ? s.m : s.n, out->regression_rows);
    const okid_status_t decomposed = decompose_theta(s, out);
    if (decomposed == OKID_OK && s.follow == 0 && knows_noise(s.config))
        out->noise_level = noise_level(s.observer_config, s.observer_work, s.theta, s.innovation, s.markov,
                                       s.config.rows, s.markov_last, s.noise);
    return decomposed;
}

okid_status_t decompose_observer_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out) {
    if (out->regression_rows < s.q) return OKID_ERR_TOO_SHORT;
    const okid_status_t status = observe_factor(s, square_root, out);
    if (status != OKID_OK) return status;
    weigh_by_factor(s, out->regression_rows);
    return decompose_theta(s, out);
}

} // namespace okid
