// SPDX-License-Identifier: MIT
// PURPOSE    one call from an accumulator to a model with its modes
// METHOD     Gram matrix, sums of one run or factor -> observer -> Markov parameters -> ERA -> order -> modes; see the modules
// REFERENCE  paper eq. (36)-(54)
// NUMERICS   see observer.cpp; the choice of the order: order.hpp
// WORKSPACE  (m(p+1))^2 for the Gram matrix, the modules' own, all in the caller's block; no heap
#include <okid/era.h>
#include <okid/identify.h>
#include <okid/markov.h>
#include <okid/modal.h>
#include <okid/structured.h>

#include "identify/order.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

struct okid_identify {
    okid_identify_config_t config;
    okid_era_config_t era_config;
    okid_observer_config_t observer_config;
    int n_u, n_y, m, n, q, max_order, markov_last;
    size_t observer_bytes, modal_bytes;
    double *gram, *mean;       ///< gram: the Gram matrix, its factor, or S of one run
    double *head, *tail, *sum; ///< of one run
    okid_real_t *theta, *innovation, *markov, *gain;
    okid_real_t *A, *B, *C, *D, *K, *closed_loop, *eigen_re, *eigen_im, *eigen_work;
    okid_real_t* scores; ///< of the order scan
    okid_real_t *frequency, *damping, *mpc, *emac, *shape_re, *shape_im, *mu_re, *mu_im, *psi_re, *psi_im;
    void *observer_work, *modal_work, *era_block;
    okid_era_t* era;
};

namespace {

bool valid(const okid_identify_config_t& c) {
    return c.n_u >= 1 && c.n_y >= 1 && c.n_u + c.n_y <= 256 && c.p >= 1 && c.p <= 4096 && c.rows >= 0 &&
           c.rows <= 8192 && c.order >= 0 && c.max_order >= 0 && c.fs_hz > 0 && std::isfinite(c.fs_hz) &&
           c.method == OKID_METHOD_OKID_ERA && (c.solver == OKID_SOLVER_DENSE || c.solver == OKID_SOLVER_STRUCTURED) &&
           (c.detrend == OKID_DETREND_NONE || c.detrend == OKID_DETREND_MEAN);
}

okid_identify plan(const okid_identify_config_t& c) {
    okid_identify s{};
    s.config = c;
    s.n_u = c.n_u;
    s.n_y = c.n_y;
    s.m = c.n_u + c.n_y;
    s.n = s.m * (c.p + 1);
    s.q = s.n - c.n_y;
    const int rows = c.rows > 0 ? c.rows : 2 * c.p;
    s.config.rows = rows;
    s.era_config = okid_era_config_t{c.n_u, c.n_y, rows, rows};
    s.observer_config = okid_observer_config_t{c.n_u, c.n_y, c.p, 0, 0};
    s.max_order = std::min({c.max_order > 0 ? c.max_order : 128, okid_era_max_order(&s.era_config), c.p * c.n_y});
    if (c.order > 0) s.max_order = std::max(s.max_order, std::min(c.order, okid_era_max_order(&s.era_config)));
    s.markov_last = 2 * rows;
    return s;
}

size_t lay_out(okid_identify& s, okid::arena& memory) {
    const auto n = static_cast<size_t>(s.n), ny = static_cast<size_t>(s.n_y), nu = static_cast<size_t>(s.n_u),
               m = nu + ny;
    const auto z = static_cast<size_t>(s.max_order), last = static_cast<size_t>(s.markov_last),
               rows = static_cast<size_t>(s.config.rows);
    auto numbers = [&](size_t count) { return memory.take<okid_real_t>(count); };
    const bool structured = s.config.solver == OKID_SOLVER_STRUCTURED;
    s.gram = memory.take<double>(structured ? m * n : n * n);
    for (double** each : {&s.head, &s.tail}) *each = memory.take<double>(structured ? n - m : 0);
    s.sum = memory.take<double>(structured ? m : 0);
    s.theta = numbers(ny * static_cast<size_t>(s.q));
    s.innovation = numbers(ny * ny);
    s.mean = memory.take<double>(m);
    s.markov = numbers((last + 1) * ny * nu);
    s.gain = numbers(std::max(last, rows) * ny * ny);
    s.A = numbers(z * z);
    s.B = numbers(z * nu);
    s.C = numbers(ny * z);
    s.D = numbers(ny * nu);
    s.K = numbers(z * ny);
    s.closed_loop = numbers(z * z);
    s.eigen_re = numbers(z);
    s.eigen_im = numbers(z);
    s.eigen_work = numbers(okid::linalg::eigen_work(s.max_order));
    const size_t modes = z / 2 + 1;
    s.scores = numbers(modes);
    for (okid_real_t** each : {&s.frequency, &s.damping, &s.mpc, &s.emac, &s.mu_re, &s.mu_im}) *each = numbers(modes);
    for (okid_real_t** each : {&s.shape_re, &s.shape_im}) *each = numbers(modes * ny);
    for (okid_real_t** each : {&s.psi_re, &s.psi_im}) *each = numbers(modes * z);
    s.observer_bytes = structured ? okid_structured_memsize(&s.observer_config)
                                  : std::max(okid_observer_memsize(&s.observer_config),
                                             okid_observer_factor_memsize(&s.observer_config));
    s.observer_work = memory.take<char>(s.observer_bytes);
    s.modal_bytes = okid_modal_memsize(s.n_y, s.max_order);
    s.modal_work = memory.take<char>(s.modal_bytes);
    s.era_block = memory.take<char>(okid_era_memsize(&s.era_config));
    return memory.bytes();
}

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
    status = constant_status(s, out, constant_channel(s, static_cast<double>(rows), [&](size_t c) {
                                 return s.gram[c * static_cast<size_t>(s.n + 1)];
                             }));
    if (status != OKID_OK) return status;
    return okid_observer_solve(&s.observer_config, s.gram, rows, s.theta, s.innovation, &out->observer_info,
                               s.observer_work, s.observer_bytes);
}

/// theta from the sums of one run.
okid_status_t observe_structured(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    okid_status_t status = okid_accumulator_run(accumulator, s.config.detrend, s.gram, s.head, s.tail, s.sum, s.mean);
    if (status != OKID_OK) return status;
    const int64_t rows = out->regression_rows;
    status = constant_status(s, out, constant_channel(s, static_cast<double>(rows), [&](size_t c) {
                                 return s.gram[c * static_cast<size_t>(s.m + 1)];
                             }));
    if (status != OKID_OK) return status;
    return okid_structured_solve(&s.observer_config, s.config.detrend, s.gram, s.head, s.tail, s.sum, rows, s.theta,
                                 s.innovation, &out->observer_info, s.observer_work, s.observer_bytes);
}

/// theta from the triangular factor, columns [u_n, v_(n-1), .., y_n].
okid_status_t observe_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out) {
    auto* factor = reinterpret_cast<okid_real_t*>(s.gram);
    okid_status_t status = okid_square_root_factor(square_root, s.config.detrend, factor, s.mean);
    if (status != OKID_OK) return status;
    const int64_t rows = out->regression_rows;
    status = constant_status(s, out, constant_channel(s, static_cast<double>(rows), [&](size_t c) {
                                 const size_t column =
                                     c < static_cast<size_t>(s.n_u) ? c : c + static_cast<size_t>(s.n - s.m);
                                 double sum = 0;
                                 for (size_t i = 0; i <= column; ++i) {
                                     const double r = factor[column * static_cast<size_t>(s.n) + i];
                                     sum += r * r;
                                 }
                                 return sum;
                             }));
    if (status != OKID_OK) return status;
    return okid_observer_solve_factor(&s.observer_config, factor, rows, s.theta, s.innovation, &out->observer_info,
                                      s.observer_work, s.observer_bytes);
}

/// Poles of the predictor A - K C.
double predictor_radius(okid_identify& s, int order) {
    std::copy(s.A, s.A + order * order, s.closed_loop);
    okid::linalg::multiply(false, false, order, order, s.n_y, -1, s.K, order, s.C, s.n_y, 1, s.closed_loop, order);
    if (okid::linalg::eigen(order, s.closed_loop, s.eigen_re, s.eigen_im, nullptr, s.eigen_work) != 0) return HUGE_VAL;
    okid_real_t radius = 0;
    for (int i = 0; i < order; ++i) radius = std::max(radius, std::hypot(s.eigen_re[i], s.eigen_im[i]));
    return radius;
}

void point_to(const okid_identify& s, okid_identified_t* out) {
    out->A = s.A;
    out->B = s.B;
    out->C = s.C;
    out->D = s.D;
    out->K = s.K;
    out->markov = s.markov;
    out->markov_count = s.markov_last + 1;
    out->observer = s.theta;
    out->innovation = s.innovation;
    out->mean = s.mean;
    out->frequency_hz = s.frequency;
    out->damping_ratio = s.damping;
    out->mpc = s.mpc;
    out->emac = s.emac;
    out->shape_re = s.shape_re;
    out->shape_im = s.shape_im;
    out->singular_values = okid_era_singular_values(s.era, &out->singular_count);
}

void begin(const okid_identify& s, okid_identified_t* out, int64_t rows) {
    *out = okid_identified_t{};
    out->n_u = s.n_u;
    out->n_y = s.n_y;
    out->p = s.config.p;
    out->rows = s.config.rows;
    out->dt = 1 / s.config.fs_hz;
    out->regression_rows = rows;
    out->observer_info.channel = -1;
}

void observer_notes(okid_identified_t* out, int q) {
    const okid_observer_info_t& info = out->observer_info;
    if (info.radius_plain >= 1) out->warnings |= OKID_NOTE_ARX_STABILISED;
    if (info.condition > 1e10) out->warnings |= OKID_NOTE_ILL_CONDITIONED;
    if (out->regression_rows < 10LL * q) out->warnings |= OKID_NOTE_FEW_ROWS;
    if (info.input_excitation < 1e-8) out->warnings |= OKID_NOTE_WEAK_EXCITATION;
}

/// The Hankel matrix of an ARX(p) model has rank p n_y at most, and near that rank every pole, noise too, looks consistent:
/// automatic orders stay below half of it.
int automatic_limit(const okid_identify& s) {
    return std::max(2, std::min(s.max_order, s.config.p * s.n_y / 2) / 2 * 2);
}

/// Realise every even order and score it; 0 when no stable model has a consistent mode.
int scan_orders(okid_identify& s, okid_identified_t* out) {
    const int count = automatic_limit(s) / 2;
    for (int k = 0; k < count; ++k) {
        const okid_status_t status = okid_identify_order(&s, 2 * (k + 1), out);
        const bool usable = status >= 0 && out->model_radius < 1;
        s.scores[k] = usable ? okid::consistency_score(s.emac, out->mode_count) : 0;
    }
    return count > 0 ? okid::order_by_score(s.scores, count) : 0;
}

/// A clear gap in the singular values decides, if its model is stable and no ridge has bent the values; else the scan.
okid_status_t automatic_order(okid_identify& s, okid_identified_t* out) {
    const okid::gap_choice gap = okid::order_by_gap(out->singular_values, out->singular_count, automatic_limit(s));
    if (gap.ratio >= okid::clear_gap && out->observer_info.radius_plain < 1) {
        const okid_status_t status = okid_identify_order(&s, gap.order, out);
        if (status >= 0 && out->model_radius < 1 && okid::consistency_score(s.emac, out->mode_count) > 0) return status;
    }
    const int order = scan_orders(s, out);
    out->warnings |= OKID_NOTE_ORDER_UNCLEAR;
    if (order > 0) return okid_identify_order(&s, order, out);
    const okid_status_t status = okid_identify_order(&s, gap.order, out);
    return status < 0 ? status : OKID_ERR_NO_MODES; // no stable model of any order has a mode that holds (EMAC > 0.5)
}

} // namespace

int32_t okid_identify_usable_p(int32_t n_u, int32_t n_y, int32_t p, int64_t samples) {
    const int64_t m = n_u + n_y;
    if (m < 1) return p;
    const int64_t largest = (samples / 10 - n_u) / m; // 10 (n_u + p m) <= samples
    return static_cast<int32_t>(std::max<int64_t>(1, std::min<int64_t>(p, largest)));
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
    const okid_status_t status =
        okid_era_create(&s->era, &s->era_config, s->era_block, okid_era_memsize(&s->era_config));
    *self = s;
    return status;
}

okid_status_t okid_identify_order(okid_identify_t* self, int32_t order, okid_identified_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_identify& s = *self;
    if (order < 1 || order > s.max_order) return OKID_ERR_DIM;
    okid_status_t status = okid_era_realize(s.era, order, s.A, s.B, s.C, s.gain, s.K);
    if (status != OKID_OK) return status;
    out->n_z = order;
    out->warnings &= ~static_cast<uint32_t>(OKID_NOTE_MODEL_UNSTABLE | OKID_NOTE_PREDICTOR_UNSTABLE);
    status = okid_modal_analyse(s.n_y, order, out->dt, s.A, s.C, &out->mode_count, s.frequency, s.damping, s.mpc,
                                s.shape_re, s.shape_im, s.mu_re, s.mu_im, s.psi_re, s.psi_im, &out->model_radius,
                                s.modal_work, s.modal_bytes);
    if (status != OKID_OK) return status;
    status = okid_era_emac(s.era, order, out->mode_count, s.mu_re, s.mu_im, s.psi_re, s.psi_im, s.emac);
    if (status != OKID_OK) return status;
    if (!(out->model_radius < 1)) out->warnings |= OKID_NOTE_MODEL_UNSTABLE;
    if (!(predictor_radius(s, order) < 1)) out->warnings |= OKID_NOTE_PREDICTOR_UNSTABLE;
    if (out->mode_count == 0) return OKID_ERR_NO_MODES;
    return out->warnings != 0 ? OKID_WARN_MODEL : OKID_OK;
}

/// From theta to the model of the order asked for.
static okid_status_t identify_from_theta(okid_identify& s, okid_identified_t* out) {
    observer_notes(out, s.q);
    okid_status_t status = okid_markov_recursion(s.n_u, s.n_y, s.config.p, s.theta, s.markov_last, s.markov, s.gain);
    if (status != OKID_OK) return status;
    status = okid_era_decompose(s.era, s.markov);
    if (status != OKID_OK) return status;
    std::copy(s.markov, s.markov + s.n_y * s.n_u, s.D);
    if (s.config.detrend == OKID_DETREND_NONE) std::fill(s.mean, s.mean + s.m, 0.0);
    point_to(s, out);
    if (s.config.order > 0) {
        if (s.config.order > s.max_order) out->warnings |= OKID_NOTE_ORDER_REDUCED;
        return okid_identify_order(&s, std::min(s.config.order, s.max_order), out);
    }
    return automatic_order(s, out);
}

okid_status_t okid_identify_run(okid_identify_t* self, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (self == nullptr || accumulator == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_identify& s = *self;
    okid_accumulator_config_t held;
    okid_accumulator_config(accumulator, &held);
    begin(s, out, okid_accumulator_rows(accumulator));
    if (held.n_u != s.n_u || held.n_y != s.n_y || held.lags != s.config.p) return OKID_ERR_MISMATCH;
    if (out->regression_rows < s.q) return OKID_ERR_TOO_SHORT;
    const okid_status_t status = s.config.solver == OKID_SOLVER_STRUCTURED ? observe_structured(s, accumulator, out)
                                                                           : observe_dense(s, accumulator, out);
    return status != OKID_OK ? status : identify_from_theta(s, out);
}

okid_status_t okid_identify_run_factor(okid_identify_t* self, okid_square_root_t* square_root, okid_identified_t* out) {
    if (self == nullptr || square_root == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_identify& s = *self;
    okid_square_root_config_t held;
    okid_square_root_config(square_root, &held);
    begin(s, out, okid_square_root_rows(square_root));
    if (held.n_u != s.n_u || held.n_y != s.n_y || held.lags != s.config.p || s.config.solver != OKID_SOLVER_DENSE)
        return OKID_ERR_MISMATCH;
    if (out->regression_rows < s.q) return OKID_ERR_TOO_SHORT;
    const okid_status_t status = observe_factor(s, square_root, out);
    return status != OKID_OK ? status : identify_from_theta(s, out);
}
