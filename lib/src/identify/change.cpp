// SPDX-License-Identifier: MIT
// PURPOSE    has a structure changed since a baseline? From sums of blocks, without an identification
// METHOD     future outputs less the part of the future inputs, multiplied with past samples, span the observability matrix.
//            With bases U of that space and S of its complement in the baseline, the space of new data is that of U + S G:
//            G = S'HV, V the instruments for which U'HV = I, so that G depends on the structure and not on the excitation.
//            Its part along each frequency of the baseline is a shift; the covariance of the shifts is that of the block
//            residuals (S' - G U')H_b V; two samples of unequal covariance are compared (Behrens-Fisher)
// REFERENCE  Basseville, Abdelghani, Benveniste (2000); Doehler, Mevel, Hille (2014), robustness to the excitation;
//            Nel, van der Merwe (1986) with Krishnamoorthy, Yu (2004), the degrees of freedom
// NUMERICS   channels are scaled to unit rms in the baseline; Gram matrices: condition squared, errors near 1e-8 of the space,
//            far below the noise that any data have. First order in G: shifts of some 5 % are too small or too large
// WORKSPACE  (blocks + 2) (2 i m)^2 doubles; per test some (i m)^3 flop, and 4 (2 i m)^2 a block and mode
#include "change.hpp"

#include "f_distribution.hpp"
#include "identify/triangular.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;

namespace {

using okid::area;
using okid::linalg::multiply;

constexpr double most_sigma =
    0.02;                       // of a frequency in the baseline: what is not known to that is noise, or hardly seen
constexpr double ridge = 1e-12; // on unit diagonals
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

bool valid(const okid_change_config_t& c) {
    if (c.n_u < 0 || c.n_y < 1 || c.n_u > 256 || c.n_y > 256 || c.rows < 2 || c.rows > 512 ||
        2 * c.rows * (c.n_u + c.n_y) > 8192)
        return false;
    return c.order >= 0 && c.order % 2 == 0 && c.order <= (c.rows - 1) * c.n_y && c.blocks >= 0 && c.blocks <= 1024 &&
           (c.false_alarm == 0 || (c.false_alarm > 0 && c.false_alarm < 1)) && c.fs_hz > 0 && std::isfinite(c.fs_hz) &&
           (c.rows - 1) * c.n_y >= 2;
}

okid_change plan(const okid_change_config_t& c) {
    okid_change s{};
    s.config = c;
    if (c.blocks == 0) s.config.blocks = 20;
    if (c.false_alarm == 0) s.config.false_alarm = 0.001;
    s.m = c.n_u + c.n_y;
    s.n_f = c.rows * c.n_u;
    s.h = c.rows * c.n_y;
    s.k = c.rows * s.m;
    s.w = s.n_f + s.h + s.k;
    s.most_order = c.order > 0 ? c.order : (c.rows - 1) * c.n_y / 2 * 2;
    s.most_modes = std::max(1, std::min((s.config.blocks - 1) / 3, s.most_order / 2));
    return s;
}

void lay_out_learning(okid_change& s, okid::arena& memory) {
    const int h = s.h, n = s.most_order, q = 2 * s.config.n_y;
    s.projected = memory.take<double>(area(s.k, h));
    for (double** each : {&s.explained, &s.vectors, &s.noise}) *each = memory.take<double>(area(h, h));
    s.values = memory.take<double>(area(h));
    s.spare = memory.take<double>(okid::linalg::symmetric_work(h, h));
    for (double** each : {&s.jacobian, &s.whitened}) *each = memory.take<double>(area(2 * h, q));
    s.normal = memory.take<double>(area(q, q));
    s.target = memory.take<double>(area(q));
    for (okid_real_t** each : {&s.transition, &s.eigenvectors}) *each = memory.take<okid_real_t>(area(n, n));
    for (okid_real_t** each : {&s.re, &s.im}) *each = memory.take<okid_real_t>(area(n));
    s.work = memory.take<okid_real_t>(okid::linalg::eigen_work(n));
    s.shape = memory.take<std::complex<double>>(area(s.config.n_y));
    for (std::complex<double>** each : {&s.powers, &s.derivative})
        *each = memory.take<std::complex<double>>(area(s.config.rows));
}

size_t lay_out(okid_change& s, okid::arena& memory) {
    const int h = s.h, n = s.most_order, d = s.most_modes, blocks = s.config.blocks;
    s.direction = memory.take<okid::change_direction>(area(n / 2));
    s.mode = memory.take<okid_change_mode_t>(area(n / 2));
    for (int k = 0; k < n / 2; ++k) {
        okid::change_direction one{};
        for (double** each : {&one.left_re, &one.left_im}) *each = memory.take<double>(area(h));
        for (double** each : {&one.right_re, &one.right_im}) *each = memory.take<double>(area(n));
        if (s.direction != nullptr) s.direction[k] = one;
    }
    s.sums = memory.take<double>(area(blocks, s.w) * static_cast<size_t>(s.w));
    s.total = memory.take<double>(area(s.w, s.w));
    s.block_rows = memory.take<double>(area(blocks));
    s.scale = memory.take<double>(area(s.m));
    for (double** each : {&s.own, &s.residual}) *each = memory.take<double>(area(h, n));
    s.outside = memory.take<double>(area(h, h));
    const int wide = std::max(d, n / 2); // while it learns, all modes of the baseline stand here
    s.at_baseline = memory.take<double>(area(wide));
    s.estimate = memory.take<double>(area(wide));
    s.deviation = memory.take<double>(area(wide, blocks));
    for (double** each : {&s.spread, &s.covariance, &s.solved, &s.weights})
        *each = memory.take<double>(area(wide, wide));
    s.free_inputs = memory.take<double>(area(s.n_f, s.n_f));
    s.regression = memory.take<double>(area(s.n_f, h + s.k));
    s.cross = memory.take<double>(area(h, s.k));
    s.past = memory.take<double>(area(s.k, s.k));
    s.future = memory.take<double>(area(h, h));
    for (double** each : {&s.seen, &s.instrument}) *each = memory.take<double>(area(s.k, n));
    s.core = memory.take<double>(area(n, n));
    for (double** each : {&s.left, &s.right, &s.half}) *each = memory.take<double>(area(s.w));
    lay_out_learning(s, memory);
    return memory.bytes();
}

/// Where row r of the regression stands in [v_n; v_(n-1); ..].
int row_in_gram(const okid_change& s, int r) {
    const int n_u = s.config.n_u, n_y = s.config.n_y, i = s.config.rows;
    if (r < s.n_f) return (i - 1 - r / n_u) * s.m + r % n_u;
    if (r < s.n_f + s.h) return (i - 1 - (r - s.n_f) / n_y) * s.m + n_u + (r - s.n_f) % n_y;
    return i * s.m + (r - s.n_f - s.h);
}

/// F test of the shifts: T^2 with the degrees of freedom of two covariances that differ.
void judge(okid_change& s, okid_change_verdict_t& out) {
    const int d = s.modes;
    out.p_value = out.statistic = out.freedom = not_a_number;
    const int counts[] = {s.added, s.baseline_blocks};
    if (std::min(counts[0], counts[1]) < okid::fewest_change_blocks) return;
    double spent = 0;
    for (int sample = 0; sample < 2; ++sample) {
        for (int j = 0; j < d * d; ++j) s.weights[j] = s.covariance[j] + s.spread[j];
        std::copy_n(sample == 0 ? s.covariance : s.spread, area(d, d), s.solved);
        if (okid::linalg::cholesky(d, s.weights, d) != 0) return;
        okid::linalg::cholesky_solve(d, s.weights, d, s.solved, d, d);
        double trace = 0, square = 0;
        for (int i = 0; i < d; ++i) {
            trace += s.solved[area(i, d + 1)];
            for (int j = 0; j < d; ++j)
                square += s.solved[area(j, d) + static_cast<size_t>(i)] * s.solved[area(i, d) + static_cast<size_t>(j)];
        }
        spent += (square + trace * trace) / (counts[sample] - 1);
    }
    for (int i = 0; i < d; ++i) s.solved[i] = s.mode[i].shift;
    okid::linalg::cholesky_solve(d, s.weights, d, s.solved, d, 1);
    out.statistic = 0;
    for (int i = 0; i < d; ++i) out.statistic += s.mode[i].shift * s.solved[i];
    out.freedom = (d + d * d) / spent;
    const double left = out.freedom - d + 1;
    if (left > 0) out.p_value = okid::f_upper_tail(out.statistic * left / (out.freedom * d), d, left);
    out.alarm = out.p_value < s.config.false_alarm ? 1 : 0;
}

/// The modes in order of what is known of them in the baseline, most first, cut to the room, then by frequency.
void keep_best(okid_change& s, int found) {
    const auto swap_modes = [&](int a, int b) {
        std::swap(s.mode[a], s.mode[b]);
        std::swap(s.direction[a], s.direction[b]);
    };
    const auto sort = [&](int count, auto before) {
        for (int a = 1; a < count; ++a)
            for (int b = a; b > 0 && before(s.mode[b], s.mode[b - 1]); --b) swap_modes(b, b - 1);
    };
    const bool known = s.added >= okid::fewest_change_blocks;
    if (known)
        sort(found, [](const okid_change_mode_t& a, const okid_change_mode_t& b) { return a.sigma < b.sigma; });
    else
        sort(found, [](const okid_change_mode_t& a, const okid_change_mode_t& b) {
            return a.damping_ratio < b.damping_ratio;
        });
    s.modes = std::min(found, s.most_modes);
    while (known && s.modes > 1 && s.mode[s.modes - 1].sigma > most_sigma) --s.modes;
    sort(s.modes,
         [](const okid_change_mode_t& a, const okid_change_mode_t& b) { return a.frequency_hz < b.frequency_hz; });
}

okid_status_t learn(okid_change& s) {
    okid::change_unscaled(s);
    if (s.rows < 2 * s.w) return OKID_ERR_TOO_SHORT;
    okid_status_t status = okid::change_space(s);
    if (status == OKID_OK) status = okid::change_estimate(s);
    if (status < 0) return status;
    for (int k = 0; k < s.modes; ++k) s.mode[k].sigma = std::sqrt(s.covariance[area(k, s.modes + 1)]);
    keep_best(s, s.modes);
    status = okid::change_estimate(s);
    if (status < 0) return status;
    std::copy_n(s.estimate, s.modes, s.at_baseline);
    std::copy_n(s.covariance, area(s.modes, s.modes), s.spread);
    s.baseline_blocks = s.added;
    s.baseline_rows = s.rows;
    return OKID_OK;
}

} // namespace

size_t okid_change_memsize(const okid_change_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_change s = plan(*config);
    okid::arena memory;
    memory.take<okid_change>(1);
    return lay_out(s, memory);
}

okid_status_t okid_change_create(okid_change_t** self, const okid_change_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_change_memsize(config)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    *self = memory.take<okid_change>(1);
    **self = plan(*config);
    lay_out(**self, memory);
    return OKID_OK;
}

okid_status_t okid_change_add(okid_change_t* self, okid_accumulator_t* sums, double* scratch) {
    if (self == nullptr || sums == nullptr || scratch == nullptr) return OKID_ERR_NULL;
    okid_change& s = *self;
    okid_accumulator_config_t of{};
    okid_accumulator_config(sums, &of);
    if (of.n_u != s.config.n_u || of.n_y != s.config.n_y || of.lags < 2 * s.config.rows - 1) return OKID_ERR_MISMATCH;
    if (s.added == s.config.blocks) return OKID_ERR_DIM;
    const okid_status_t status = okid_accumulator_gram(sums, OKID_DETREND_MEAN, scratch, nullptr);
    if (status < 0) return status;
    const int size = s.m * (of.lags + 1);
    double* to = s.sums + area(s.added, s.w) * static_cast<size_t>(s.w);
    for (int c = 0; c < s.w; ++c) {
        const double* from = scratch + area(row_in_gram(s, c), size);
        for (int r = 0; r < s.w; ++r) to[area(c, s.w) + static_cast<size_t>(r)] = from[row_in_gram(s, r)];
    }
    s.block_rows[s.added++] = static_cast<double>(okid_accumulator_rows(sums));
    s.rows += s.block_rows[s.added - 1];
    return OKID_OK;
}

okid_status_t okid_change_learn(okid_change_t* self) {
    if (self == nullptr) return OKID_ERR_NULL;
    self->order = self->modes = 0;
    const okid_status_t status = learn(*self);
    if (status < 0) self->order = self->modes = 0;
    okid_change_clear(self);
    return status;
}

okid_status_t okid_change_test(okid_change_t* self, okid_change_verdict_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_change& s = *self;
    if (s.modes == 0) return OKID_ERR_MISMATCH;
    const okid_status_t status = s.rows < 2 * s.w ? OKID_ERR_TOO_SHORT : okid::change_estimate(s);
    if (status == OKID_OK) {
        *out = {};
        out->modes = s.modes;
        out->blocks = s.added;
        const bool known = std::min(s.added, s.baseline_blocks) >= okid::fewest_change_blocks;
        double most = -1;
        for (int k = 0; k < s.modes; ++k) {
            okid_change_mode_t& mode = s.mode[k];
            mode.shift = s.estimate[k] - s.at_baseline[k];
            const double variance = s.covariance[area(k, s.modes + 1)] + s.spread[area(k, s.modes + 1)];
            mode.sigma = known ? std::sqrt(variance) : not_a_number;
            const double size = std::abs(mode.shift) / (known ? mode.sigma : 1);
            if (size > most) most = size, out->farthest = k;
        }
        judge(s, *out);
    }
    okid_change_clear(self);
    return status;
}

void okid_change_clear(okid_change_t* self) {
    if (self == nullptr) return;
    self->added = 0;
    self->rows = 0;
}

int32_t okid_change_blocks(const okid_change_t* self) { return self != nullptr ? self->added : 0; }
int32_t okid_change_order(const okid_change_t* self) { return self != nullptr ? self->order : 0; }

okid_status_t okid_change_mode(const okid_change_t* self, int32_t k, okid_change_mode_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    if (k < 0 || k >= self->modes) return OKID_ERR_DIM;
    *out = self->mode[k];
    return OKID_OK;
}

namespace okid {

void change_unscaled(okid_change& s) { std::fill_n(s.scale, s.m, 1.0); }

/// total <- scaled sums of the blocks, then the future inputs taken out of everything else.
okid_status_t change_reduce(okid_change& s) {
    const int w = s.w, f = s.n_f, rest = s.h + s.k;
    std::fill_n(s.total, area(w, w), 0.0);
    for (int b = 0; b < s.added; ++b)
        for (size_t j = 0; j < area(w, w); ++j) s.total[j] += s.sums[area(b, w) * static_cast<size_t>(w) + j];
    for (int c = 0; c < w; ++c)
        for (int r = 0; r < w; ++r)
            s.total[area(c, w) + static_cast<size_t>(r)] *=
                s.scale[row_in_gram(s, c) % s.m] * s.scale[row_in_gram(s, r) % s.m] / s.rows;
    if (f > 0) {
        for (int c = 0; c < f; ++c)
            std::copy_n(s.total + area(c, w), f, s.free_inputs + area(c, f)),
                s.free_inputs[area(c, f + 1)] *= 1 + ridge;
        for (int c = 0; c < rest; ++c) std::copy_n(s.total + area(f + c, w), f, s.regression + area(c, f));
        if (linalg::cholesky(f, s.free_inputs, f) != 0) return OKID_ERR_EXCITATION;
        linalg::cholesky_solve(f, s.free_inputs, f, s.regression, f, rest);
        double* corner = s.total + area(f, w) + f;
        multiply(false, false, rest, rest, f, -1, s.total + f, w, s.regression, f, 1, corner, w);
    }
    const double* future = s.total + area(f, w) + f;
    const double* past = s.total + area(f + s.h, w) + f;
    for (int c = 0; c < s.h; ++c) std::copy_n(future + area(c, w), s.h, s.future + area(c, s.h));
    for (int c = 0; c < s.k; ++c) {
        std::copy_n(past + area(c, w), s.h, s.cross + area(c, s.h));
        std::copy_n(past + area(c, w) + s.h, s.k, s.past + area(c, s.k));
        s.past[area(c, s.k + 1)] = s.past[area(c, s.k + 1)] * (1 + ridge) + ridge;
    }
    return linalg::cholesky(s.k, s.past, s.k) == 0 ? OKID_OK : OKID_ERR_EXCITATION;
}

namespace {

/// instrument <- V of U'HV = I, residual <- G = S'HV.
okid_status_t locate(okid_change& s) {
    const int n = s.order, h = s.h, k = s.k, out = h - n;
    multiply(true, false, k, n, h, 1, s.cross, h, s.own, h, 0, s.seen, k);
    std::copy_n(s.seen, area(k, n), s.instrument);
    linalg::cholesky_solve(k, s.past, k, s.instrument, k, n);
    multiply(true, false, n, n, k, 1, s.seen, k, s.instrument, k, 0, s.core, n);
    for (int j = 0; j < n; ++j) s.core[area(j, n + 1)] *= 1 + ridge;
    if (linalg::cholesky(n, s.core, n) != 0) return OKID_ERR_EXCITATION;
    for (int r = 0; r < k; ++r) { // V <- V core^-1, a row at a time
        for (int j = 0; j < n; ++j) s.half[j] = s.instrument[area(j, k) + static_cast<size_t>(r)];
        linalg::cholesky_solve(n, s.core, n, s.half, n, 1);
        for (int j = 0; j < n; ++j) s.instrument[area(j, k) + static_cast<size_t>(r)] = s.half[j];
    }
    multiply(false, false, h, n, k, 1, s.cross, h, s.instrument, k, 0, s.seen, h); // H V; seen has room: h <= k
    multiply(true, false, out, n, h, 1, s.outside, h, s.seen, h, 0, s.residual, out);
    return OKID_OK;
}

/// left <- S p - U G'p and right <- V psi, each with its part of the future inputs before it. @return p G psi
double look(okid_change& s, const double* p, const double* psi) {
    const int n = s.order, h = s.h, k = s.k, f = s.n_f, out = h - n;
    multiply(false, false, out, 1, n, 1, s.residual, out, psi, n, 0, s.half, out);
    double value = 0;
    for (int j = 0; j < out; ++j) value += p[j] * s.half[j];
    multiply(true, false, n, 1, out, 1, s.residual, out, p, out, 0, s.half, n);
    multiply(false, false, h, 1, out, 1, s.outside, h, p, out, 0, s.left + f, h);
    multiply(false, false, h, 1, n, -1, s.own, h, s.half, n, 1, s.left + f, h);
    multiply(false, false, k, 1, n, 1, s.instrument, k, psi, n, 0, s.right + f, k);
    if (f > 0) {
        multiply(false, false, f, 1, h, -1, s.regression, f, s.left + f, h, 0, s.left, f);
        multiply(false, false, f, 1, k, -1, s.regression + area(h, f), f, s.right + f, k, 0, s.right, f);
    }
    const auto scaled = [&](double* v, int row, int count) {
        for (int j = 0; j < count; ++j) v[j] *= s.scale[row_in_gram(s, row + j) % s.m];
    };
    scaled(s.left, 0, f + h);
    scaled(s.right, 0, f);
    scaled(s.right + f, f + h, k);
    return value;
}

/// What block b makes of left and right.
double of_block(okid_change& s, int b) {
    const int w = s.w, f = s.n_f, h = s.h, k = s.k;
    const double* sums = s.sums + area(b, w) * static_cast<size_t>(w);
    if (f > 0) multiply(false, false, f + h, 1, f, 1, sums, w, s.right, f, 0, s.half, f + h);
    multiply(false, false, f + h, 1, k, 1, sums + area(f + h, w), w, s.right + f, k, f > 0 ? 1 : 0, s.half, f + h);
    double value = 0;
    for (int j = 0; j < f + h; ++j) value += s.left[j] * s.half[j];
    return value / s.rows;
}

} // namespace

okid_status_t change_estimate(okid_change& s) {
    okid_status_t status = change_reduce(s);
    if (status == OKID_OK) status = locate(s);
    if (status < 0) return status;
    const int d = s.modes, blocks = s.added;
    for (int j = 0; j < d; ++j) {
        const change_direction& to = s.direction[j];
        double* row = s.deviation + area(j, blocks);
        s.estimate[j] = look(s, to.left_re, to.right_re);
        for (int b = 0; b < blocks; ++b) row[b] = of_block(s, b);
        s.estimate[j] += look(s, to.left_im, to.right_im);
        for (int b = 0; b < blocks; ++b) row[b] += of_block(s, b);
        if (!std::isfinite(s.estimate[j])) return OKID_ERR_NUMERIC;
    }
    multiply(true, false, d, d, blocks, blocks > 1 ? blocks / (blocks - 1.0) : 1, s.deviation, blocks, s.deviation,
             blocks, 0, s.covariance, d);
    return OKID_OK;
}

} // namespace okid
