// SPDX-License-Identifier: MIT
// PURPOSE    one call from an accumulator to a model with its modes
// METHOD     OKID (identify_observer.cpp), covariances of the outputs (identify_covariance.cpp) or a subspace
//            (identify_subspace.cpp), then order and modes (identify_order.cpp)
// REFERENCE  paper eq. (36)-(95)
// NUMERICS   see the modules
// WORKSPACE  (m(lags+1))^2 for the Gram matrix, the modules' own, all in the caller's block; no heap
#include "identify/identify.hpp"

#include "identify/subspace.hpp"

#include <okid/modal.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace {

constexpr int default_rows = 30, default_order = 128; // rows: of the n4sid methods

bool is_subspace(okid_method_t method) {
    return method == OKID_METHOD_N4SID_MOESP || method == OKID_METHOD_N4SID_CVA || method == OKID_METHOD_N4SID_SSARX;
}

bool valid_sizes(const okid_identify_config_t& c) {
    if (c.n_y < 1 || c.n_u < 0 || c.n_u + c.n_y > 256 || c.rows < 0 || c.rows > 8192) return false;
    if (is_subspace(c.method)) return c.rows != 1 && c.solver == OKID_SOLVER_DENSE && c.hankel == OKID_HANKEL_SYSTEM;
    if (c.method != OKID_METHOD_OKID_ERA && c.method != OKID_METHOD_OKID_ERA_DC) return false;
    if (c.n_u == 0)
        return c.p >= 0 && c.p <= 4096 && std::max(c.p, c.rows) >= 1 && c.solver == OKID_SOLVER_DENSE &&
               c.hankel == OKID_HANKEL_SYSTEM;
    return c.p >= 1 && c.p <= 4096 && (c.solver == OKID_SOLVER_DENSE || c.solver == OKID_SOLVER_STRUCTURED) &&
           c.hankel >= OKID_HANKEL_SYSTEM && c.hankel <= OKID_HANKEL_LITERAL;
}

void plan_era(okid_identify& s) {
    const okid_identify_config_t& c = s.config;
    s.width = s.by_covariance ? c.n_y : c.hankel == OKID_HANKEL_SYSTEM ? c.n_u : s.m;
    s.era_config = okid_era_config_t{s.width, c.n_y, c.rows, c.rows, 0, 0, 0};
    if (c.method == OKID_METHOD_OKID_ERA_DC) s.era_config.xi = s.era_config.zeta = 2, s.era_config.tau = 1;
    s.markov_last = okid_era_markov_last(&s.era_config);
    const int carried = okid_era_max_order(&s.era_config), past = s.by_covariance ? c.rows : c.p;
    s.max_order = std::min({c.max_order > 0 ? c.max_order : default_order, carried, past * c.n_y});
    s.max_order = std::max(s.max_order, std::min(c.order, carried));
}

void plan_observer(okid_identify& s) {
    const okid_identify_config_t& c = s.config;
    plan_era(s);
    s.lags = c.p;
    s.observer_config = okid_observer_config_t{c.n_u, c.n_y, c.p, 0, 0};
    s.q = s.n_u + c.p * s.m;
}

void plan_covariance(okid_identify& s) {
    plan_era(s);
    s.lags = s.markov_last;
    s.q = s.config.rows * s.n_y;
}

void plan_subspace(okid_identify& s) {
    const okid_identify_config_t& c = s.config;
    s.lags = 2 * c.rows - 1;
    s.q = c.rows * (s.m + s.n_u);
    s.markov_last = 2 * c.rows;
    const int carried = (c.rows - 1) * c.n_y, wanted = c.max_order > 0 ? c.max_order : default_order;
    s.max_order = std::min(std::max(wanted, c.order), carried);
    const int weighting = c.method - OKID_METHOD_N4SID_MOESP; // the two enumerations stand in one order
    s.subspace_config = okid_subspace_config_t{c.n_u, c.n_y, c.rows, weighting, s.max_order, 1, 0};
}

okid_identify plan(const okid_identify_config_t& c) {
    okid_identify s{};
    s.config = c;
    s.by_subspace = is_subspace(c.method);
    s.n_u = c.n_u;
    s.n_y = c.n_y;
    s.m = c.n_u + c.n_y;
    s.by_covariance = !s.by_subspace && c.n_u == 0;
    if (c.rows == 0) s.config.rows = s.by_subspace ? default_rows : s.by_covariance ? c.p : 2 * c.p;
    if (s.by_subspace)
        plan_subspace(s);
    else if (s.by_covariance)
        plan_covariance(s);
    else
        plan_observer(s);
    s.n = s.m * (s.lags + 1);
    return s;
}

bool valid(const okid_identify_config_t& c) {
    if (!valid_sizes(c) || c.order < 0 || c.max_order < 0 || !(c.fs_hz > 0) || !std::isfinite(c.fs_hz) ||
        (c.detrend != OKID_DETREND_NONE && c.detrend != OKID_DETREND_MEAN))
        return false;
    const okid_identify s = plan(c);
    return !s.by_subspace || okid_subspace_max_order(&s.subspace_config) > 0;
}

/// What the observer or the covariances and ERA need, or the subspace in their place.
void lay_out_storey(okid_identify& s, okid::arena& memory) {
    const auto n = static_cast<size_t>(s.n), ny = static_cast<size_t>(s.n_y), m = static_cast<size_t>(s.m);
    if (s.by_subspace) {
        s.gram = memory.take<double>(n * n);
        s.powers = memory.take<okid_real_t>(2 * static_cast<size_t>(s.max_order) * static_cast<size_t>(s.n_u));
        s.storey_block = memory.take<char>(okid_subspace_memsize(&s.subspace_config));
        return;
    }
    if (s.by_covariance) {
        s.gram = memory.take<double>(n * n);
        okid::lay_out_covariance(s, memory);
        s.storey_block = memory.take<char>(okid_era_memsize(&s.era_config));
        return;
    }
    const bool structured = s.config.solver == OKID_SOLVER_STRUCTURED;
    s.gram = memory.take<double>(structured ? m * n : n * n);
    for (double** each : {&s.head, &s.tail}) *each = memory.take<double>(structured ? n - m : 0);
    s.sum = memory.take<double>(structured ? m : 0);
    s.theta = memory.take<okid_real_t>(ny * static_cast<size_t>(s.q));
    s.gain = memory.take<okid_real_t>(static_cast<size_t>(std::max(s.markov_last, s.config.rows)) * ny * ny);
    if (s.config.hankel != OKID_HANKEL_SYSTEM) {
        s.sequence = memory.take<okid_real_t>((static_cast<size_t>(s.markov_last) + 1) * ny * m);
        s.input_root = memory.take<okid_real_t>((m - ny) * (m - ny));
        s.innovation_root = memory.take<okid_real_t>(ny * ny);
    }
    s.observer_bytes = structured ? okid_structured_memsize(&s.observer_config)
                                  : std::max(okid_observer_memsize(&s.observer_config),
                                             okid_observer_factor_memsize(&s.observer_config));
    s.observer_work = memory.take<char>(s.observer_bytes);
    if (okid::knows_noise(s.config)) s.noise.lay_out(s.observer_config, s.config.rows, s.markov_last, memory);
    s.storey_block = memory.take<char>(okid_era_memsize(&s.era_config));
}

size_t lay_out(okid_identify& s, okid::arena& memory) {
    const auto ny = static_cast<size_t>(s.n_y), nu = static_cast<size_t>(s.n_u), z = static_cast<size_t>(s.max_order),
               modes = z / 2 + 1;
    auto numbers = [&](size_t count) { return memory.take<okid_real_t>(count); };
    lay_out_storey(s, memory);
    s.innovation = numbers(ny * ny);
    s.mean = memory.take<double>(static_cast<size_t>(s.m));
    s.markov = numbers((static_cast<size_t>(s.markov_last) + 1) * ny * nu);
    s.A = numbers(z * z);
    s.B = numbers(z * (s.by_subspace ? nu : static_cast<size_t>(s.width)));
    s.C = numbers(ny * z);
    s.D = numbers(ny * nu);
    s.K = numbers(z * ny);
    s.closed_loop = numbers(z * z);
    s.eigen_re = numbers(z);
    s.eigen_im = numbers(z);
    s.eigen_work = numbers(okid::linalg::eigen_work(s.max_order));
    s.scores = numbers(modes);
    for (okid_real_t** each : {&s.frequency, &s.damping, &s.mpc, &s.emac, &s.cmi, &s.mu_re, &s.mu_im})
        *each = numbers(modes);
    for (okid_real_t** each : {&s.shape_re, &s.shape_im}) *each = numbers(modes * ny);
    for (okid_real_t** each : {&s.psi_re, &s.psi_im}) *each = numbers(modes * z);
    s.modal_bytes = okid_modal_memsize(s.n_y, s.max_order);
    s.modal_work = memory.take<char>(s.modal_bytes);
    return memory.bytes();
}

void point_to(const okid_identify& s, okid_identified_t* out) {
    out->A = s.A;
    out->B = s.B;
    out->C = s.C;
    out->D = s.D;
    out->K = s.K;
    out->markov = s.markov;
    out->markov_count = s.n_u > 0 ? s.markov_last + 1 : 0;
    out->observer = s.theta;
    out->innovation = s.innovation;
    out->mean = s.mean;
    out->frequency_hz = s.frequency;
    out->damping_ratio = s.damping;
    out->mpc = s.mpc;
    out->emac = s.emac;
    out->cmi = s.cmi;
    out->shape_re = s.shape_re;
    out->shape_im = s.shape_im;
    out->singular_values = s.by_subspace ? okid_subspace_singular_values(s.subspace, &out->singular_count)
                                         : okid_era_singular_values(s.era, &out->singular_count);
}

void begin(const okid_identify& s, okid_identified_t* out, int64_t rows) {
    *out = okid_identified_t{};
    out->n_u = s.n_u;
    out->n_y = s.n_y;
    out->p = s.by_subspace || s.by_covariance ? s.config.rows : s.config.p;
    out->rows = s.config.rows;
    out->dt = 1 / s.config.fs_hz;
    out->regression_rows = rows;
    out->observer_info.channel = -1;
    out->noise_level = NAN;
}

okid_status_t decompose(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    const auto by = s.by_subspace     ? okid::decompose_subspace_gram
                    : s.by_covariance ? okid::decompose_covariance
                                      : okid::decompose_observer_gram;
    return by(s, accumulator, out);
}

/// From what was decomposed to the model.
okid_status_t finish(okid_identify& s, okid_status_t decomposed, okid_identified_t* out) {
    if (decomposed != OKID_OK) return decomposed;
    if (s.config.detrend == OKID_DETREND_NONE) std::fill(s.mean, s.mean + s.m, 0.0);
    point_to(s, out);
    return okid::choose_order(s, out);
}

} // namespace

okid_identify okid::plan_of(const okid_identify_config_t& config) { return plan(config); }

okid_status_t okid::replicate(okid_identify& s, okid_accumulator_t* accumulator, int order, okid_identified_t* out) {
    begin(s, out, okid_accumulator_rows(accumulator));
    s.follow = order;
    s.poles_only = false;
    okid_status_t status = decompose(s, accumulator, out);
    if (status == OKID_OK) status = realise_model(s, order);
    s.follow = 0;
    if (status != OKID_OK) return status;
    point_to(s, out);
    out->n_z = order;
    return OKID_OK;
}

int32_t okid_identify_usable_p(int32_t n_u, int32_t n_y, int32_t p, int64_t samples) {
    const int64_t m = n_u + n_y;
    if (m < 1) return p;
    const int64_t largest = (samples / 10 - n_u) / m; // 10 (n_u + p m) <= samples
    return static_cast<int32_t>(std::max<int64_t>(1, std::min<int64_t>(p, largest)));
}

int32_t okid_identify_lags(const okid_identify_config_t* config) {
    return config == nullptr || !valid(*config) ? 0 : plan(*config).lags;
}

int32_t okid_identify_max_order(const okid_identify_config_t* config) {
    return config == nullptr || !valid(*config) ? 0 : plan(*config).max_order;
}

size_t okid_identify_memsize(const okid_identify_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_identify s = plan(*config);
    okid::arena memory;
    memory.take<okid_identify>(1);
    return lay_out(s, memory);
}

okid_status_t okid_identify_create(okid_identify_t** self, const okid_identify_config_t* config, void* block,
                                   size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_identify_memsize(config)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    auto* s = memory.take<okid_identify>(1);
    *s = plan(*config);
    lay_out(*s, memory);
    *self = s;
    return s->by_subspace ? okid_subspace_create(&s->subspace, &s->subspace_config, s->storey_block,
                                                 okid_subspace_memsize(&s->subspace_config))
                          : okid_era_create(&s->era, &s->era_config, s->storey_block, okid_era_memsize(&s->era_config));
}

namespace {

/// What the sums must be for this configuration; then their decomposition.
okid_status_t take_sums(okid_identify& s, okid_accumulator_t* accumulator, bool poles_only, okid_identified_t* out) {
    okid_accumulator_config_t held;
    okid_accumulator_config(accumulator, &held);
    begin(s, out, okid_accumulator_rows(accumulator));
    if (held.n_u != s.n_u || held.n_y != s.n_y || held.lags != s.lags) return OKID_ERR_MISMATCH;
    s.from_sums = true;
    s.poles_only = poles_only;
    return decompose(s, accumulator, out);
}

} // namespace

okid_status_t okid_identify_run(okid_identify_t* self, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (self == nullptr || accumulator == nullptr || out == nullptr) return OKID_ERR_NULL;
    return finish(*self, take_sums(*self, accumulator, false, out), out);
}

okid_status_t okid_identify_decompose(okid_identify_t* self, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (self == nullptr || accumulator == nullptr || out == nullptr) return OKID_ERR_NULL;
    const okid_status_t status = take_sums(*self, accumulator, true, out);
    self->poles_only = status == OKID_OK; // else no factor stands for another method
    if (status == OKID_OK) point_to(*self, out);
    return status;
}

okid_status_t okid_identify_decompose_as(okid_identify_t* self, okid_method_t method, int32_t order,
                                         okid_identified_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_identify_config_t other = self->config;
    other.method = method;
    if (!self->by_subspace || !self->poles_only || !valid(other)) return OKID_ERR_MISMATCH;
    const okid_identify planned = plan(other);
    if (!planned.by_subspace) return OKID_ERR_MISMATCH;
    const okid_status_t status = okid::decompose_as(self->subspace, planned.subspace_config.method, order);
    if (status != OKID_OK) return status;
    self->config.method = method;
    point_to(*self, out);
    return OKID_OK;
}

okid_status_t okid_identify_run_factor(okid_identify_t* self, okid_square_root_t* square_root, okid_identified_t* out) {
    if (self == nullptr || square_root == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_identify& s = *self;
    okid_square_root_config_t held;
    okid_square_root_config(square_root, &held);
    begin(s, out, okid_square_root_rows(square_root));
    if (held.n_u != s.n_u || held.n_y != s.n_y || held.lags != s.lags || s.config.solver != OKID_SOLVER_DENSE ||
        s.by_covariance)
        return OKID_ERR_MISMATCH;
    s.from_sums = s.poles_only = false;
    return finish(s,
                  s.by_subspace ? okid::decompose_subspace_factor(s, square_root, out)
                                : okid::decompose_observer_factor(s, square_root, out),
                  out);
}

const char* okid_warning_code(uint32_t bit) {
    switch (bit) {
    case OKID_NOTE_ARX_STABILISED: return "arx_stabilised";
    case OKID_NOTE_ILL_CONDITIONED: return "ill_conditioned";
    case OKID_NOTE_FEW_ROWS: return "few_rows";
    case OKID_NOTE_MODEL_UNSTABLE: return "model_unstable";
    case OKID_NOTE_PREDICTOR_UNSTABLE: return "predictor_unstable";
    case OKID_NOTE_ORDER_REDUCED: return "order_reduced";
    case OKID_NOTE_ORDER_UNCLEAR: return "order_unclear";
    case OKID_NOTE_WEAK_EXCITATION: return "weak_excitation";
    case OKID_NOTE_LITERAL_HANKEL: return "literal_hankel";
    default: return nullptr;
    }
}
