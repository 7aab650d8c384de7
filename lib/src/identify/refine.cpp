// SPDX-License-Identifier: MIT
// PURPOSE    maximum-likelihood refinement of a model, with delete-one-block replicates
// METHOD     Levenberg-Marquardt on the output-error likelihood in modal coordinates; the eigenvectors of the start stay
//            the basis of the states throughout. Replicates: one undamped step with the score of a block
// REFERENCE  Ljung, System Identification (1999) ch. 7, 10; Efron, Tibshirani, An Introduction to the Bootstrap (1993)
//            ch. 11; docs/numerics.md, refinement
// NUMERICS   residuals are simulated, not taken from the Gram matrix: exact down to rounding. Normal equations in double
// WORKSPACE  two Gram matrices and the equations, some 6 total^2 numbers; one pass over the records an iteration
#include <okid/refine.h>

#include "identify/refine_moments.hpp"
#include "identify/refine_pass.hpp"
#include "identify/signs.hpp"

#include <cmath>

using okid::area;
using okid::at;
using okid::linalg::multiply;
using std::size_t;

struct okid_refine {
    okid_refine_config_t config;
    okid::refine_layout layout;
    okid::refine_parameters best, trial;
    okid::refine_sums at_best, at_trial;
    okid::refine_equations equations;
    okid::refine_change change;
    okid::refine_pass pass;
    okid::refine_moments moments;
    const okid_correlation_sums_t* sums; ///< what is refined, instead of records
    double *basis, *inverse;             ///< n_z x n_z: states = basis times modal coordinates
    double *spare, *product;             ///< n_z x max(n_z, n_u, n_y, runs)
    double *scores, *drive;              ///< of the blocks; n_u: mean square of the inputs
    okid_real_t *a, *vectors, *re, *im, *eigen;
    okid_real_t *A, *B, *C, *D, *x0, *noise;
    bool ready; ///< the equations of the result are factored
};

namespace {

constexpr double enough = 1e-3;       // log-likelihood that a step must promise to be worth it: 1/20 of a deviation
constexpr double at_rounding = 1e-24; // mean square of the residuals over that of the outputs
constexpr double truncated = 1e-2;    // what a mode may have left of its amplitude after the lags of the sums
constexpr int tries = 12;             // of the damping, and of halving the step of a pole

bool valid(const okid_refine_config_t& c) {
    constexpr int most = 1 << 14;
    return c.n_u >= (c.runs > 0 ? 0 : 1) && c.n_y >= 1 && c.n_z >= 1 && c.runs >= 0 && c.n_u <= most && c.n_y <= most &&
           c.n_z <= most && c.runs <= most && (c.blocks == 0 || (c.blocks >= 2 && c.blocks <= 64)) &&
           c.iterations >= 0 && (c.offset == 0 || c.offset == 1) &&
           static_cast<long long>(c.n_z) * (c.n_u + c.runs + 1) + c.n_u + c.runs <= most;
}

void lay_out(okid_refine& s, const okid_refine_config_t& c, okid::arena& memory) {
    s.config = c;
    okid::refine_layout& l = s.layout;
    l = {c.n_u, c.n_y, c.n_z, c.runs, c.offset != 0, nullptr, nullptr, nullptr, 1};
    for (bool** flags : {&l.pair, &l.held}) *flags = memory.take<bool>(area(c.n_z));
    l.fixed = memory.take<int>(area(c.n_z));
    s.best.lay_out(l, memory);
    s.trial.lay_out(l, memory);
    s.at_best.lay_out(l, memory);
    s.at_trial.lay_out(l, memory);
    s.equations.lay_out(l, memory);
    s.change.lay_out(l, memory);
    if (c.runs > 0)
        s.pass.lay_out(l, memory);
    else
        s.moments.lay_out(l, memory);
    const int widest = std::max({c.n_z, c.n_u, c.n_y, c.runs});
    for (double** square : {&s.basis, &s.inverse}) *square = memory.take<double>(area(c.n_z, c.n_z));
    for (double** wide : {&s.spare, &s.product}) *wide = memory.take<double>(area(c.n_z, widest));
    s.scores = memory.take<double>(area(l.total(), c.n_y) * static_cast<size_t>(c.blocks));
    s.drive = memory.take<double>(area(c.n_u));
    for (okid_real_t** square : {&s.a, &s.vectors, &s.A}) *square = memory.take<okid_real_t>(area(c.n_z, c.n_z));
    for (okid_real_t** column : {&s.re, &s.im}) *column = memory.take<okid_real_t>(area(c.n_z));
    s.eigen = memory.take<okid_real_t>(okid::linalg::eigen_work(c.n_z));
    s.B = memory.take<okid_real_t>(area(c.n_z, c.n_u));
    s.C = memory.take<okid_real_t>(area(c.n_y, c.n_z));
    s.D = memory.take<okid_real_t>(area(c.n_y, c.n_u));
    s.x0 = memory.take<okid_real_t>(area(c.n_z, c.runs));
    s.noise = memory.take<okid_real_t>(area(c.n_y));
    s.ready = false;
}

/// inverse <- basis^-1 by normal equations, corrected once.
bool invert_basis(okid_refine& s) {
    const int n = s.layout.n_z;
    double *normal = s.spare, *miss = s.product;
    multiply(true, false, n, n, n, 1, s.basis, n, s.basis, n, 0, normal, n);
    if (okid::linalg::cholesky(n, normal, n) != 0) return false;
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) s.inverse[at(r, c, n)] = s.basis[at(c, r, n)];
    okid::linalg::cholesky_solve(n, normal, n, s.inverse, n, n);
    double largest = 0;
    for (int turn = 0; turn < 2; ++turn) {
        largest = 0;
        std::fill(miss, miss + area(n, n), 0.0);
        for (int k = 0; k < n; ++k) miss[at(k, k, n)] = 1;
        multiply(false, false, n, n, n, -1, s.basis, n, s.inverse, n, 1, miss, n);
        for (size_t k = 0; k < area(n, n); ++k) largest = std::max(largest, std::abs(miss[k]));
        for (int c = 0; c < n; ++c) { // basis^T miss, column by column into `equations.core`, which is at least n x n
            multiply(true, false, n, 1, n, 1, s.basis, n, miss + at(0, c, n), n, 0, s.equations.core, n);
            okid::linalg::cholesky_solve(n, normal, n, s.equations.core, n, 1);
            for (int r = 0; r < n; ++r) s.inverse[at(r, c, n)] += s.equations.core[r];
        }
    }
    return largest < 1e-3;
}

/// Poles and vectors of the start, in an order that the poles alone tell: real ones first, then by frequency.
/// @return false: not all are numbers
bool sort_modes(okid_refine& s) {
    okid::refine_layout& l = s.layout;
    const int n = l.n_z;
    for (int to = 0; to < n; to += l.size(to)) {
        int next = -1;
        for (int k = 0; k < n; k += s.im[k] > 0 ? 2 : 1) {
            if (std::isnan(s.re[k])) continue; // taken
            if (next < 0 || s.im[k] < s.im[next] || (s.im[k] == s.im[next] && s.re[k] < s.re[next])) next = k;
        }
        if (next < 0) return false;
        l.pair[to] = s.im[next] > 0;
        s.best.pole[to] = double(s.re[next]);
        for (int r = 0; r < n; ++r) s.basis[at(r, to, n)] = double(s.vectors[at(r, next, n)]);
        if (l.pair[to]) {
            s.best.pole[to + 1] = double(s.im[next]);
            for (int r = 0; r < n; ++r) s.basis[at(r, to + 1, n)] = -double(s.vectors[at(r, next + 1, n)]);
        }
        s.re[next] = NAN;
    }
    return true;
}

/// Choose the gain that is held in each mode, and turn the mode so that this gain is positive. A mode's phase is then that
/// of the transfer function, whatever states the start has; of gains as large as each other the first one is taken.
void turn_modes(okid_refine& s) {
    constexpr double as_large = 1 + 1e-6;
    okid::refine_layout& l = s.layout;
    const int n = l.n_z;
    for (int k = 0; k < n; k += l.size(k)) {
        double largest = -1;
        for (int c = 0; c < l.n_u; ++c) {
            const double* b = s.best.input + at(k, c, n);
            const double power = (b[0] * b[0] + (l.pair[k] ? b[1] * b[1] : 0)) * s.drive[c];
            if (power > as_large * largest) l.fixed[k] = c, largest = power;
        }
        const double* b = s.best.input + at(k, l.fixed[k], n);
        const std::complex<double> gain(b[0], l.pair[k] ? b[1] : 0.0);
        const std::complex<double> turn = gain == 0.0 ? 1.0 : std::conj(gain) / std::abs(gain);
        const auto rotate = [&](double* part, int step) {
            const double x = part[0];
            part[0] *= turn.real();
            if (!l.pair[k]) return;
            part[0] -= turn.imag() * part[step];
            part[step] = turn.real() * part[step] + turn.imag() * x;
        };
        for (int i = 0; i < n; ++i) { // columns of the basis, whose second part has the other sign; rows of its inverse
            rotate(s.basis + at(i, k, n), n);
            rotate(s.inverse + at(k, i, n), 1);
        }
        for (int c = 0; c < l.n_u; ++c) rotate(s.best.input + at(k, c, n), 1);
    }
}

/// The start in modal coordinates; its initial states zero.
okid_status_t decompose(okid_refine& s, const okid_model_t& start) {
    okid::refine_layout& l = s.layout;
    const int n = l.n_z, n_u = l.n_u, n_y = l.n_y;
    std::copy(start.A, start.A + area(n, n), s.a);
    if (!std::all_of(s.a, s.a + area(n, n), [](okid_real_t x) { return std::isfinite(x); })) return OKID_ERR_NUMERIC;
    if (okid::linalg::eigen(n, s.a, s.re, s.im, s.vectors, s.eigen) != 0) return OKID_ERR_NUMERIC;
    if (!sort_modes(s)) return OKID_ERR_NUMERIC;
    std::fill(l.held, l.held + n, false);
    for (int k = 0; k < n; k += l.size(k))
        if (!s.best.inside(l, k)) return OKID_ERR_UNSTABLE;
    if (!invert_basis(s)) return OKID_ERR_NUMERIC;
    std::copy(start.B, start.B + area(n, n_u), s.spare);
    multiply(false, false, n, n_u, n, 1, s.inverse, n, s.spare, n, 0, s.best.input, n);
    if (n_u > 0) turn_modes(s);
    std::copy(start.C, start.C + area(n_y, n), s.spare);
    multiply(false, false, n_y, n, n, 1, s.spare, n_y, s.basis, n, 0, s.best.shows + area(n_y, n_u), n_y);
    std::copy(start.D, start.D + area(n_y, n_u), s.best.shows);
    std::fill(s.best.start, s.best.start + area(n, l.runs), 0.0);
    return OKID_OK;
}

/// Mean squares of the channels; refuses a missing input.
okid_status_t look_at(okid_refine& s, const okid::refine_records& records) {
    const int n_u = s.layout.n_u, n_y = s.layout.n_y;
    std::fill(s.drive, s.drive + n_u, 0.0);
    std::fill(s.at_best.output, s.at_best.output + n_y, 0.0);
    const double* v = records.samples;
    long long used = 0;
    for (int r = 0; r < s.layout.runs; ++r)
        for (int t = 0; t < records.counts[r]; ++t, v += n_u + n_y) {
            for (int c = 0; c < n_u; ++c) {
                if (!std::isfinite(v[c])) return OKID_ERR_MISMATCH;
                s.drive[c] += v[c] * v[c];
            }
            if (!std::all_of(v + n_u, v + n_u + n_y, [](double y) { return std::isfinite(y); })) continue;
            for (int o = 0; o < n_y; ++o) s.at_best.output[o] += v[n_u + o] * v[n_u + o];
            ++used;
        }
    if (used * n_y <= static_cast<long long>(okid::refine_parameters::count(s.layout))) return OKID_ERR_TOO_SHORT;
    for (int o = 0; o < n_y; ++o) s.at_best.output[o] /= double(used);
    std::copy_n(s.at_best.output, n_y, s.at_trial.output);
    return OKID_OK;
}

/// The same from sums.
okid_status_t look_at(okid_refine& s, const okid_correlation_sums_t& sums) {
    const int n_u = s.layout.n_u, n_y = s.layout.n_y, m = n_u + n_y;
    if (sums.rows * n_y <= static_cast<double>(okid::refine_parameters::count(s.layout))) return OKID_ERR_TOO_SHORT;
    for (int c = 0; c < n_u; ++c) s.drive[c] = sums.U[at(c, c, m)];
    for (int o = 0; o < n_y; ++o) s.at_best.output[o] = s.at_trial.output[o] = sums.Y[at(n_u + o, o, m)] / sums.rows;
    return OKID_OK;
}

void accept(okid_refine& s) {
    std::swap(s.best, s.trial);
    std::swap(s.at_best, s.at_trial);
}

/// Shorten the step of every pole that would leave its place until it stays.
void keep_inside(okid_refine& s) {
    const okid::refine_layout& l = s.layout;
    for (int k = 0; k < l.n_z; k += l.size(k))
        for (int turn = 0; turn < tries && !s.trial.inside(l, k); ++turn)
            for (int i = k; i < k + l.size(k); ++i)
                s.trial.pole[i] = turn + 1 < tries ? (s.trial.pole[i] + s.best.pole[i]) / 2 : s.best.pole[i];
}

/// What a step needs at `p`, from the records or from their sums.
void sum_up(okid_refine& s, const okid::refine_parameters& p, const okid::refine_records& records,
            okid::refine_sums& out) {
    if (s.sums != nullptr)
        s.moments.sum(p, *s.sums, out);
    else
        s.pass.sum(p, records, out);
}

/// Try the step in `change`. @return it was better, and is taken
bool attempt(okid_refine& s, const okid::refine_records& records) {
    s.change.add_to(s.layout, s.best, 1, s.trial);
    keep_inside(s);
    sum_up(s, s.trial, records, s.at_trial);
    if (!(s.at_trial.likelihood > s.at_best.likelihood)) return false;
    accept(s);
    return true;
}

/// Hold the poles that the undamped step in `change` would put out of their place. @return there were any
bool hold_leaving(okid_refine& s) {
    const okid::refine_layout& l = s.layout;
    bool any = false;
    s.change.add_to(l, s.best, 1.0 / 16, s.trial);
    for (int k = 0; k < l.n_z; k += l.size(k)) {
        if (s.trial.inside(l, k) || l.held[k]) continue;
        std::fill(l.held + k, l.held + k + l.size(k), true);
        any = true;
    }
    return any;
}

bool exact(const okid_refine& s) {
    for (int o = 0; o < s.layout.n_y; ++o)
        if (s.at_best.square[o] > at_rounding * s.at_best.output[o]) return false;
    return true;
}

/// One damped step that is better; mu grows until there is one. @return there was one
bool advance(okid_refine& s, const okid::refine_records& records, double& mu) {
    for (int turn = 0; turn < tries; ++turn) {
        if (mu == 0 || s.equations.damp(mu)) {
            s.equations.step(s.at_best.with_e, s.change);
            if (attempt(s, records)) return true;
        }
        mu = std::max(1e-3, 10 * mu);
    }
    return false;
}

/// Steps until there is no more gain.
void improve(okid_refine& s, const okid::refine_records& records, okid_refined_t& out) {
    const int most = s.config.iterations > 0 ? s.config.iterations : 30;
    double mu = 0;
    while (s.equations.prepare(s.best, s.at_best, false) && s.equations.damp(0)) {
        out.decrement = s.equations.step(s.at_best.with_e, s.change) / 2;
        if (hold_leaving(s)) continue;
        out.converged = out.decrement < enough || exact(s) ? 1 : 0;
        if (out.converged != 0 || out.iterations == most) return;
        if (!advance(s, records, mu)) return;
        mu = mu > 1e-5 ? mu / 10 : 0;
        ++out.iterations;
    }
}

/// Where the likelihood is not at its very top, the scores do not add up to zero.
void centre_scores(const okid_refine& s) {
    const size_t size = area(s.layout.total(), s.layout.n_y);
    for (size_t k = 0; k < size && s.config.blocks > 0; ++k) {
        double sum = 0;
        for (size_t b = 0; b < static_cast<size_t>(s.config.blocks); ++b) sum += s.scores[b * size + k];
        for (size_t b = 0; b < static_cast<size_t>(s.config.blocks); ++b)
            s.scores[b * size + k] -= sum / s.config.blocks;
    }
}

/// Scores of blocks as white noise of the size found would give them: draws whose covariance is the Fisher matrix over the blocks.
void draw_scores(okid_refine& s) {
    const int t = s.layout.total(), n_y = s.layout.n_y;
    double *factor = s.at_trial.gram, *draw = s.equations.residual;
    const auto scale = [&](int i) { return std::sqrt(std::max(s.at_best.gram[at(i, i, t)], 0.0)); };
    constexpr double floor = 1e-12;
    for (int c = 0; c < t; ++c)
        for (int r = 0; r < t; ++r) {
            const double size = scale(r) * scale(c);
            factor[at(r, c, t)] = (size > 0 ? s.at_best.gram[at(r, c, t)] / size : 0) + (r == c ? floor : 0);
        }
    if (okid::linalg::cholesky(t, factor, t) != 0) std::fill(factor, factor + area(t, t), NAN);
    okid::signs sign;
    for (size_t b = 0; b < static_cast<size_t>(s.config.blocks); ++b)
        for (int o = 0; o < n_y; ++o) {
            double* score = s.scores + b * area(t, n_y) + at(0, o, t);
            std::fill(score, score + t, 0.0);
            for (int c = 0; c < t; ++c) {
                draw[c] = sign() * std::sqrt(s.at_best.square[o] / s.config.blocks);
                for (int r = c; r < t; ++r) score[r] += factor[at(r, c, t)] * draw[c];
            }
            for (int r = 0; r < t; ++r) score[r] *= scale(r);
        }
}

void put(const double* from, size_t count, okid_real_t* to) {
    for (size_t k = 0; k < count; ++k) to[k] = static_cast<okid_real_t>(from[k]);
}

/// Parameters to a model in the states of the start.
void realise(const okid_refine& s, const okid::refine_parameters& p, okid_real_t* A, okid_real_t* B, okid_real_t* C,
             okid_real_t* D) {
    const okid::refine_layout& l = s.layout;
    const int n = l.n_z;
    for (int k = 0; k < n; k += l.size(k)) { // basis times the blocks [re -im; im re]
        const std::complex<double> w = p.w(l, k);
        const double *f = s.basis + at(0, k, n), *g = f + (l.pair[k] ? n : 0);
        double* to = s.spare + at(0, k, n);
        for (int r = 0; r < n; ++r) {
            to[r] = w.real() * f[r] + w.imag() * g[r];
            if (l.pair[k]) to[n + r] = w.real() * g[r] - w.imag() * f[r];
        }
    }
    multiply(false, false, n, n, n, 1, s.spare, n, s.inverse, n, 0, s.product, n);
    put(s.product, area(n, n), A);
    multiply(false, false, n, l.n_u, n, 1, s.basis, n, p.input, n, 0, s.product, n);
    put(s.product, area(n, l.n_u), B);
    multiply(false, false, l.n_y, n, n, 1, p.shows + area(l.n_y, l.n_u), l.n_y, s.inverse, n, 0, s.product, l.n_y);
    put(s.product, area(l.n_y, n), C);
    put(p.shows, area(l.n_y, l.n_u), D);
}

void publish(okid_refine& s, okid_refined_t& out) {
    const okid::refine_layout& l = s.layout;
    realise(s, s.best, s.A, s.B, s.C, s.D);
    if (l.runs > 0)
        multiply(false, false, l.n_z, l.runs, l.n_z, 1, s.basis, l.n_z, s.best.start, l.n_z, 0, s.product, l.n_z);
    put(s.product, area(l.n_z, l.runs), s.x0);
    const double n = double(s.at_best.used), free = double(l.linear() * l.n_y + l.shaped()) / l.n_y;
    for (int o = 0; o < l.n_y; ++o)
        s.noise[o] = static_cast<okid_real_t>(std::sqrt(s.at_best.square[o] * n / std::max(1.0, n - free)));
    out.samples = s.at_best.used;
    out.A = s.A;
    out.B = s.B;
    out.C = s.C;
    out.D = s.D;
    out.x0 = l.runs > 0 ? s.x0 : nullptr;
    out.noise_std = s.noise;
}

} // namespace

size_t okid_refine_memsize(const okid_refine_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid::arena memory;
    memory.take<okid_refine>(1);
    okid_refine unused{};
    lay_out(unused, *config, memory);
    return memory.bytes();
}

okid_status_t okid_refine_create(okid_refine_t** self, const okid_refine_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    const size_t needed = okid_refine_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    auto* s = new (memory.take<okid_refine>(1)) okid_refine{};
    lay_out(*s, *config, memory);
    *self = s;
    return OKID_OK;
}

namespace {

/// From the start, whose modal coordinates are taken first, to the result.
okid_status_t refine(okid_refine& s, const okid_model_t& start, const okid::refine_records& records,
                     okid_refined_t& out) {
    okid_status_t status = s.sums != nullptr ? look_at(s, *s.sums) : look_at(s, records);
    if (status == OKID_OK) status = decompose(s, start);
    if (status != OKID_OK) return status;
    sum_up(s, s.best, records, s.at_best);
    if (!std::isfinite(s.at_best.likelihood)) return OKID_ERR_NUMERIC;
    if (s.layout.runs > 0 && s.equations.prepare(s.best, s.at_best, true) && s.equations.damp(0)) {
        s.equations.step(s.at_best.with_e, s.change);
        attempt(s, records);
    }
    if (s.layout.n_u == 0) okid::hold_starts(s.layout, s.best);
    out = okid_refined_t{};
    const double before = s.at_best.likelihood;
    improve(s, records, out);
    out.gain = s.at_best.likelihood - before;
    std::fill(s.layout.held, s.layout.held + s.layout.n_z, false); // replicates and deviations: every pole may move
    s.ready = s.equations.prepare(s.best, s.at_best, false) && s.equations.damp(0);
    return OKID_OK;
}

bool fits(const okid_refine& s, const okid_model_t& start) {
    return start.n_u == s.layout.n_u && start.n_y == s.layout.n_y && start.n_z == s.layout.n_z;
}

bool complete(const okid_model_t* start) {
    return start != nullptr && start->A != nullptr && start->C != nullptr &&
           (start->n_u == 0 || (start->B != nullptr && start->D != nullptr));
}

} // namespace

okid_status_t okid_refine_run(okid_refine_t* self, const okid_model_t* start, const int32_t* counts,
                              const double* samples, okid_refined_t* out) {
    if (self == nullptr || !complete(start) || counts == nullptr || samples == nullptr || out == nullptr)
        return OKID_ERR_NULL;
    okid_refine& s = *self;
    if (!fits(s, *start) || s.layout.runs == 0) return OKID_ERR_MISMATCH;
    if (std::any_of(counts, counts + s.layout.runs, [](int32_t n) { return n < 0; })) return OKID_ERR_DIM;
    const okid::refine_records records{counts, samples};
    s.ready = false;
    s.sums = nullptr;
    const okid_status_t status = refine(s, *start, records, *out);
    if (status != OKID_OK) return status;
    out->whiteness = s.pass.score(s.best, records, s.at_best, s.config.blocks, s.scores);
    if (s.layout.n_u == 0)
        draw_scores(s); // a fast mode lives in one block: the scores of the others know nothing of it
    centre_scores(s);
    publish(s, *out);
    return out->converged != 0 ? OKID_OK : OKID_WARN_MODEL;
}

okid_status_t okid_refine_from_correlation(okid_refine_t* self, const okid_model_t* start,
                                           const okid_correlation_sums_t* sums, okid_refined_t* out) {
    if (self == nullptr || !complete(start) || sums == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_refine& s = *self;
    if (!fits(s, *start) || s.layout.runs != 0 || sums->n_u != start->n_u || sums->n_y != start->n_y)
        return OKID_ERR_MISMATCH;
    s.ready = false;
    s.sums = sums;
    s.layout.radius = std::pow(truncated, 1.0 / sums->lags);
    const okid_status_t status = refine(s, *start, {}, *out);
    s.sums = nullptr; // they are the caller's
    if (status != OKID_OK) return status;
    draw_scores(s);
    centre_scores(s);
    publish(s, *out);
    return out->converged != 0 ? OKID_OK : OKID_WARN_MODEL;
}

okid_status_t okid_refine_replicate(okid_refine_t* self, int32_t index, okid_real_t* A, okid_real_t* B, okid_real_t* C,
                                    okid_real_t* D) {
    if (self == nullptr || A == nullptr || B == nullptr || C == nullptr || D == nullptr) return OKID_ERR_NULL;
    const okid_refine& s = *self;
    const int blocks = s.config.blocks;
    if (blocks == 0 || !s.ready) return OKID_ERR_MISMATCH;
    if (index < 0 || index >= blocks) return OKID_ERR_DIM;
    s.equations.step(s.scores + area(s.layout.total(), s.layout.n_y) * static_cast<size_t>(index), s.change);
    s.change.add_to(s.layout, s.best, -double(blocks) / (blocks - 1), s.trial);
    realise(s, s.trial, A, B, C, D);
    return OKID_OK;
}
