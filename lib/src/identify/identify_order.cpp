// SPDX-License-Identifier: MIT
// PURPOSE    models of one order from a decomposition, and the automatic order
// METHOD     a clear gap in the singular values, else the scan of order.hpp
// REFERENCE  docs/numerics.md, order
// NUMERICS   what gap is clear depends on the kind of singular values: order.hpp
// WORKSPACE  in the object
#include "identify/identify.hpp"

#include <okid/modal.h>
#include <okid/steps/era.h>
#include <okid/steps/subspace.h>

#include "identify/emac.hpp"
#include "identify/order.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace okid {
namespace {

/// Poles of the predictor A - K C.
double predictor_radius(okid_identify& s, int order) {
    std::copy(s.A, s.A + order * order, s.closed_loop);
    okid::linalg::multiply(false, false, order, order, s.n_y, -1, s.K, order, s.C, s.n_y, 1, s.closed_loop, order);
    if (okid::linalg::eigen(order, s.closed_loop, s.eigen_re, s.eigen_im, nullptr, s.eigen_work) != 0) return HUGE_VAL;
    okid_real_t radius = 0;
    for (int i = 0; i < order; ++i) radius = std::max(radius, std::hypot(s.eigen_re[i], s.eigen_im[i]));
    return radius;
}

/// A, B, C, D, K of one order; `whole` false: A and C are enough.
okid_status_t realise_subspace(okid_identify& s, int order, bool whole) {
    okid_real_t *B = whole && s.n_u > 0 ? s.B : nullptr, *D = B != nullptr ? s.D : nullptr;
    okid_status_t status =
        okid_subspace_realize(s.subspace, order, s.A, B, s.C, D, whole ? s.K : nullptr, whole ? s.innovation : nullptr);
    if (status != OKID_ERR_NUMERIC || !whole) return status;
    status = okid_subspace_realize(s.subspace, order, s.A, B, s.C, D, nullptr, nullptr); // a model without a predictor
    std::fill(s.K, s.K + order * s.n_y, okid_real_t{0});
    std::fill(s.innovation, s.innovation + s.n_y * s.n_y, okid_real_t{0});
    return status;
}

/// Outputs that are multiples of the inputs of the same instant but for rounding: the same channels given twice, a loop
/// of cable. What is left of a response is noise of the last digits, and any number of poles fits it.
bool without_dynamics(const okid_identify& s) {
    constexpr okid_real_t rounding = 100 * std::numeric_limits<okid_real_t>::epsilon();
    const okid_real_t limit = std::max(static_cast<okid_real_t>(1e-9), rounding);
    const int block = s.n_y * s.n_u;
    for (int row = 0; row < s.n_y && s.n_u > 0; ++row) {
        okid_real_t now = 0, later = 0;
        for (int i = row; i < block * (s.markov_last + 1); i += s.n_y) {
            okid_real_t& side = i < block ? now : later;
            side = std::max(side, std::abs(s.markov[i]));
        }
        if (later > limit * now) return false;
    }
    return s.n_u > 0;
}

/// @param while_it_lasts  of EMAC, see emac.hpp; automatic orders take the end of the horizon
okid_status_t realise(okid_identify& s, int order, bool whole, okid_identified_t* out, bool while_it_lasts = false) {
    if (order < 1 || order > s.max_order) return OKID_ERR_DIM;
    okid_status_t status = s.by_subspace     ? realise_subspace(s, order, whole)
                           : s.by_covariance ? realise_covariance(s, order, whole)
                                             : realise_era(s, order, whole);
    if (status != OKID_OK) return status;
    out->n_z = order;
    out->warnings &= ~static_cast<uint32_t>(OKID_NOTE_MODEL_UNSTABLE | OKID_NOTE_PREDICTOR_UNSTABLE);
    const okid_model_t model{s.n_u, s.n_y, order, s.A, s.B, s.C, s.D, s.K};
    okid_modes_t modes{0,          0,       s.frequency, s.damping, s.mpc,   s.shape_re,
                       s.shape_im, s.mu_re, s.mu_im,     s.psi_re,  s.psi_im};
    status = okid_modal_analyse(&model, out->dt, &modes, s.modal_work, s.modal_bytes);
    if (status != OKID_OK) return status;
    out->mode_count = modes.count;
    out->model_radius = modes.radius;
    status = s.by_subspace ? subspace_emac(s.subspace, order, s.C, &modes, s.emac, while_it_lasts)
                           : era_emac(s.era, order, &modes, s.emac, while_it_lasts);
    if (status != OKID_OK) return status;
    for (int k = 0; k < out->mode_count; ++k) s.cmi[k] = s.emac[k] * s.mpc[k];
    if (!(out->model_radius < 1)) out->warnings |= OKID_NOTE_MODEL_UNSTABLE;
    if (whole && !(predictor_radius(s, order) < 1)) out->warnings |= OKID_NOTE_PREDICTOR_UNSTABLE;
    if (whole && s.by_subspace) model_markov(s, order);
    if (out->mode_count == 0 || (whole && without_dynamics(s))) return OKID_ERR_NO_MODES;
    return out->warnings != 0 ? OKID_WARN_MODEL : OKID_OK;
}

/// Near the rank that p (n4sid: rows) past samples can have at most, every pole, noise too, looks consistent: automatic
/// orders stay below half of it.
int automatic_limit(const okid_identify& s) {
    const int past = s.by_subspace || s.by_covariance ? s.config.rows : s.config.p;
    return std::max(2, std::min(s.max_order, past * s.n_y / 2) / 2 * 2);
}

/// Realise every even order from `least` to `largest` and score it; 0 when no stable model has a consistent mode.
int scan_orders(okid_identify& s, int least, int largest, okid_identified_t* out) {
    const int count = largest / 2;
    std::fill(s.scores, s.scores + count, okid_real_t{0});
    for (int k = least / 2 - 1; k < count; ++k) {
        const okid_status_t status = realise(s, 2 * (k + 1), false, out);
        const bool usable = status >= 0 && out->model_radius < 1;
        s.scores[k] = usable ? consistency_score(s.emac, out->mode_count) : 0;
    }
    return count > 0 ? order_by_score(s.scores, count) : 0;
}

double clear_gap_of(okid_method_t method) {
    if (method == OKID_METHOD_OKID_ERA_DC) return clear_correlation_gap;
    return method == OKID_METHOD_N4SID_CVA || method == OKID_METHOD_N4SID_SSARX ? clear_canonical_gap : clear_gap;
}

/// Singular values above the noise level; 0 where that is not known, or a ridge has bent the values.
int above_noise(const okid_identified_t& out) {
    if (!(out.noise_level > 0) || !(out.observer_info.radius_plain < 1)) return 0;
    return static_cast<int>(std::count_if(out.singular_values, out.singular_values + out.singular_count,
                                          [&](okid_real_t value) { return value > out.noise_level; }));
}

/// A gap in the singular values decides, if it is clear or stands where the noise begins, its model is stable and no ridge
/// has bent the values; else the scan, from what stands above the noise to twice as much.
okid_status_t automatic_order(okid_identify& s, okid_identified_t* out) {
    const int limit = automatic_limit(s), signal = above_noise(*out);
    const gap_choice gap = order_by_gap(out->singular_values, out->singular_count, limit);
    const bool clear =
        gap.ratio >= clear_gap_of(s.config.method) || (gap.order == signal && gap.ratio >= least_gap_at_noise);
    if (clear && out->observer_info.radius_plain < 1) {
        const okid_status_t status = realise(s, gap.order, true, out);
        if (status >= 0 && out->model_radius < 1 && consistency_score(s.emac, out->mode_count) > 0) return status;
    }
    int order = 0;
    if (signal >= 2) order = scan_orders(s, std::min(limit, signal) / 2 * 2, std::min(limit, 2 * signal), out);
    if (order == 0) order = scan_orders(s, 2, limit, out);
    out->warnings |= OKID_NOTE_ORDER_UNCLEAR;
    if (order > 0) return realise(s, order, true, out);
    const okid_status_t status = realise(s, gap.order, true, out);
    return status < 0 ? status : OKID_ERR_NO_MODES; // no stable model of any order has a mode that holds (EMAC > 0.5)
}

} // namespace

okid_status_t realise_model(okid_identify& s, int order) {
    if (s.followed != nullptr) return s.followed->realise(s.era_config, s.markov, s.A, s.B, s.C);
    if (s.by_covariance) return realise_covariance(s, order, false);
    if (!s.by_subspace) return realise_era(s, order, false);
    const bool inputs = s.n_u > 0 && !s.modes_only;
    if (!inputs) {
        std::fill_n(s.B, order * s.n_u, okid_real_t{0});
        std::fill_n(s.D, s.n_y * s.n_u, okid_real_t{0});
    }
    return okid_subspace_realize(s.subspace, order, s.A, inputs ? s.B : nullptr, s.C, inputs ? s.D : nullptr, nullptr,
                                 nullptr);
}

okid_status_t choose_order(okid_identify& s, okid_identified_t* out) {
    if (s.config.order == 0) return automatic_order(s, out);
    if (s.config.order > s.max_order) out->warnings |= OKID_NOTE_ORDER_REDUCED;
    return realise(s, std::min(s.config.order, s.max_order), true, out);
}

} // namespace okid

okid_status_t okid_identify_order(okid_identify_t* self, int32_t order, okid_identified_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    return okid::realise(*self, order, true, out);
}

okid_status_t okid_identify_poles(okid_identify_t* self, int32_t order, okid_identified_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    return okid::realise(*self, order, false, out, true);
}

okid_status_t okid_identify_set_inputs(okid_identify_t* self, const okid_real_t* B, const okid_real_t* D,
                                       okid_identified_t* out) {
    if (self == nullptr || B == nullptr || D == nullptr || out == nullptr) return OKID_ERR_NULL;
    if (!self->by_subspace || out->n_z < 1 || out->n_z > self->max_order) return OKID_ERR_MISMATCH;
    std::copy(B, B + out->n_z * self->n_u, self->B);
    std::copy(D, D + self->n_y * self->n_u, self->D);
    okid::model_markov(*self, out->n_z);
    return OKID_OK;
}
