// SPDX-License-Identifier: MIT
// PURPOSE    replicate models, each without one block of the record, from sums alone
// METHOD     sums of the whole less those of the block, identified at the order of the full model by what okid_identify_run()
//            does, less the scans and checks that no deviation needs; ERA starts from the full model (followed_era). Or the
//            full model plus its derivative along the sums of the block (linear.hpp), poles and vectors to first order
//            (first_order.hpp)
// REFERENCE  docs/numerics.md, uncertainty
// NUMERICS   codes: the sums without the block are exact; doubles: a rounding of the whole. Linear: the sums of a block are
//            taken about the means of the whole, which is the derivative of the centred sums
// WORKSPACE  an identifier, one accumulator, 2 m doubles, or room for the Gram matrix of a block and linear.hpp's; no heap
#include <okid/uncertainty.h>

#include "accumulate/lag_means.h"
#include "identify/first_order.hpp"
#include "identify/identify.hpp"
#include "identify/linear.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

using std::size_t;

struct okid_jackknife {
    okid_jackknife_config_t config;
    okid_identify_t* identifier;
    okid_accumulator_t *whole, *rest; ///< the caller's; the whole less a part
    double *energy, *taken;           ///< of the channels: of the whole, of a part
    int order, channels;
    bool may_follow; ///< plain ERA
    okid::followed_era followed;
    void *identifier_block, *rest_block;
    size_t identifier_bytes, rest_bytes;
    double *gram, *mean,
        *part_mean;      ///< linear: Gram matrix of a part, or room for it; lag-row means of the whole, of a part
    double* diagonal;    ///< of the Gram matrix of a part
    int size;            ///< of gram
    okid_run_sums_t run; ///< of a part that is one run
    okid::linear_era era;
    okid::linear_subspace subspace;
    okid::linear_ssarx ssarx;
    okid::first_order beside; ///< of linear models
    bool begun;               ///< it has the model
};

namespace {

bool valid(const okid_jackknife_config_t& c) {
    if (c.linear != 0 && c.identify.hankel != OKID_HANKEL_SYSTEM) return false; // it has no derivative
    const int32_t lags = okid_identify_lags(&c.identify);
    return lags > 0 && c.identify.solver == OKID_SOLVER_DENSE && okid_accumulator_memsize(&c.sums) > 0 &&
           c.sums.n_u == c.identify.n_u && c.sums.n_y == c.identify.n_y && c.sums.lags == lags && c.sums.edges != 0 &&
           c.sums.slots == 0;
}

void lay_out_linear(okid_jackknife& s, okid::arena& memory) {
    const okid_identify shape = okid::plan_of(s.config.identify);
    s.size = shape.n;
    s.gram = memory.take<double>(static_cast<size_t>(s.size) * static_cast<size_t>(s.size));
    const auto n = static_cast<size_t>(s.size), m = static_cast<size_t>(s.channels);
    for (double** each : {&s.mean, &s.part_mean, &s.diagonal, &s.run.head, &s.run.tail}) *each = memory.take<double>(n);
    for (double** each : {&s.run.sum, &s.run.mean}) *each = memory.take<double>(m);
    s.run.S = memory.take<double>(m * n);
    if (shape.config.method == OKID_METHOD_N4SID_SSARX)
        s.ssarx.lay_out(shape, shape.max_order, memory);
    else if (shape.by_subspace)
        s.subspace.lay_out(shape, shape.max_order, memory);
    else
        s.era.lay_out(shape, shape.max_order, memory);
    s.beside.lay_out(shape.n_u, shape.n_y, shape.max_order, memory);
}

size_t lay_out(okid_jackknife& s, okid::arena& memory) {
    s.channels = s.config.sums.n_u + s.config.sums.n_y;
    for (double** each : {&s.energy, &s.taken}) *each = memory.take<double>(static_cast<size_t>(s.channels));
    if (s.config.linear != 0) {
        lay_out_linear(s, memory);
        return memory.bytes();
    }
    s.identifier_bytes = okid_identify_memsize(&s.config.identify);
    s.rest_bytes = okid_accumulator_memsize(&s.config.sums);
    s.identifier_block = memory.take<char>(s.identifier_bytes);
    s.rest_block = memory.take<char>(s.rest_bytes);
    const okid_identify_config_t& c = s.config.identify;
    s.may_follow = c.n_u > 0 && c.method == OKID_METHOD_OKID_ERA && c.hankel == OKID_HANKEL_SYSTEM;
    if (s.may_follow) {
        const int rows = c.rows > 0 ? c.rows : 2 * c.p;
        s.followed.lay_out({c.n_u, c.n_y, rows, rows, 0, 0, 0}, okid_identify_max_order(&c), memory);
    }
    return memory.bytes();
}

/// asked.products <- G asked.columns, G the Gram matrix of one run: some columns at a time, the first from the sums, the others
/// along the diagonals (what enters less what leaves). To remove means it is made about those of lag 0, and its products moved
/// to those of every lag row of the whole.
void multiply_run(const okid_jackknife& s, const okid_run_sums_t& run, const okid::asked_of_gram& asked) {
    constexpr int some = 64;
    const int m = s.channels, n = s.size, p = n / m - 1, wide = std::min(std::max(1, some / m), p) * m;
    const bool centred = s.config.identify.detrend != OKID_DETREND_NONE;
    const auto rows = static_cast<double>(run.rows);
    double* sum = s.part_mean; // of the lag rows
    for (int i = 0; centred && i < n; ++i) {
        sum[i] = i < m ? run.sum[i] : sum[i - m] + run.head[i - m] - run.tail[i - m];
        for (int c = 0; c < m; ++c)
            run.S[i * m + c] += rows * s.mean[c] * s.mean[i % m] - run.sum[c] * s.mean[i % m] - s.mean[c] * sum[i];
    }
    for (int i = 0; centred && i < m * p; ++i) {
        run.head[i] -= s.mean[i % m];
        run.tail[i] -= s.mean[i % m];
    }
    double *strip = s.gram + okid::at(0, m, n), *last = s.gram; // the columns in hand behind the m before them
    for (int first = 0; first < n; first += wide) {
        const int count = std::min(wide, n - first);
        for (int j = first; j < first + count; ++j) {
            double* column = strip + okid::at(0, j - first, n);
            const double* before = column - okid::at(0, m, n);
            for (int i = 0; i < m; ++i) column[i] = run.S[j < m ? i * m + j : j * m + i];
            for (int i = m; j < m && i < n; ++i) column[i] = run.S[i * m + j];
            const double enters = j < m ? 0 : run.head[j - m], leaves = j < m ? 0 : run.tail[j - m];
            for (int i = m; j >= m && i < n; ++i)
                column[i] = before[i - m] + enters * run.head[i - m] - leaves * run.tail[i - m];
            s.diagonal[j] = column[j];
        }
        okid::linalg::multiply(false, false, n, asked.count, count, 1, strip, n, asked.columns + first, n, first > 0,
                               asked.products, n);
        std::copy(strip + okid::at(0, count - m, n), strip + okid::at(0, count, n), last);
    }
    if (!centred) return;
    double* apart = run.head; // of the means, lag row for lag row
    for (int i = 0; i < n; ++i) {
        sum[i] -= rows * (s.mean[i % m] + s.mean[i]) / 2;
        apart[i] = s.mean[i] - s.mean[i % m];
        s.diagonal[i] -= 2 * sum[i] * apart[i];
    }
    for (int k = 0; k < asked.count; ++k) {
        const double* x = asked.columns + okid::at(0, k, n);
        const double by_sum = std::inner_product(sum, sum + n, x, 0.0),
                     by_step = std::inner_product(apart, apart + n, x, 0.0);
        double* y = asked.products + okid::at(0, k, n);
        for (int i = 0; i < n; ++i) y[i] -= by_sum * apart[i] + by_step * sum[i];
    }
}

/// The same for any part, about the means of the whole.
okid_status_t multiply_part(okid_jackknife& s, okid_accumulator_t* part, const okid::asked_of_gram& asked) {
    const okid_detrend_t detrend = s.config.identify.detrend;
    if (s.config.sums.forgetting == 1 && s.size > s.channels &&
        okid_accumulator_run(part, OKID_DETREND_NONE, &s.run) == OKID_OK) {
        multiply_run(s, s.run, asked);
        return OKID_OK;
    }
    const okid_status_t status = okid_accumulator_gram(part, detrend, s.gram, nullptr);
    if (status != OKID_OK) return status;
    if (detrend != OKID_DETREND_NONE) {
        const double rows = okid_accumulator_lag_means(part, s.part_mean); // its own means, and how far they are away
        for (int c = 0; c < s.size; ++c) s.part_mean[c] -= s.mean[c];
        for (int c = 0; c < s.size; ++c) {
            const double factor = rows * s.part_mean[c];
            for (int r = 0; r < s.size; ++r) s.gram[okid::at(r, c, s.size)] += factor * s.part_mean[r];
        }
    }
    for (int c = 0; c < s.size; ++c) s.diagonal[c] = s.gram[okid::at(c, c, s.size)];
    okid::linalg::multiply(false, false, s.size, asked.count, s.size, 1, s.gram, s.size, asked.columns, s.size, 0,
                           asked.products, s.size);
    return OKID_OK;
}

/// Share of the part, each channel counting alike; what is left of the whole keeps a little too.
double share_of(const okid_jackknife& s, double weight) {
    constexpr double least = 1e-9;
    double share = 0;
    for (int c = 0; c < s.channels; ++c) share += s.energy[c] > 0 ? weight * s.taken[c] / s.energy[c] : 0;
    return std::clamp(share / s.channels, least, 1 - least);
}

/// The model plus step times its derivative along the part.
okid_model_t along(okid_jackknife& s, double step) {
    return s.ssarx.size > 0      ? s.ssarx.along(step)
           : s.subspace.size > 0 ? s.subspace.along(step)
                                 : s.era.along(s.diagonal, step);
}

} // namespace

size_t okid_jackknife_memsize(const okid_jackknife_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_jackknife s{};
    s.config = *config;
    okid::arena memory;
    memory.take<okid_jackknife>(1);
    return lay_out(s, memory);
}

okid_status_t okid_jackknife_create(okid_jackknife_t** self, const okid_jackknife_config_t* config, void* block,
                                    size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_jackknife_memsize(config)) return OKID_ERR_MEMORY;
    okid::arena memory(block);
    auto* s = memory.take<okid_jackknife>(1);
    *s = okid_jackknife{};
    s->config = *config;
    lay_out(*s, memory);
    *self = s;
    if (config->linear != 0) return OKID_OK;
    const okid_status_t status = okid_accumulator_create(&s->rest, &s->config.sums, s->rest_block, s->rest_bytes);
    if (status != OKID_OK) return status;
    return okid_identify_create(&s->identifier, &s->config.identify, s->identifier_block, s->identifier_bytes);
}

okid_status_t okid_jackknife_begin(okid_jackknife_t* self, okid_accumulator_t* whole, const okid_identified_t* full) {
    if (self == nullptr || whole == nullptr || full == nullptr) return OKID_ERR_NULL;
    okid_jackknife& s = *self;
    if (s.config.linear != 0) return OKID_ERR_MISMATCH;
    if (full->n_z < 1 || full->n_z > s.identifier->max_order) return OKID_ERR_DIM;
    s.identifier->modes_only = s.config.modes_only != 0;
    okid_status_t status = okid_accumulator_copy(s.rest, whole); // does it fit?
    if (status == OKID_OK) status = okid_accumulator_energy(whole, s.config.identify.detrend, s.energy);
    s.whole = whole;
    s.order = full->n_z;
    s.identifier->observer_config.ridge_min = full->observer_info.ridge;
    // a ridge of its own would make a replicate another estimate, often far away
    s.identifier->observer_config.unstable = 2;
    const bool follows =
        s.may_follow && full->model_radius < 1 && s.followed.begin(s.identifier->era_config, s.order, full->A, full->C);
    s.identifier->followed = follows ? &s.followed : nullptr;
    return status;
}

okid_status_t okid_jackknife_begin_linear(okid_jackknife_t* self, okid_identify_t* by, okid_accumulator_t* whole,
                                          const okid_identified_t* full) {
    if (self == nullptr || by == nullptr || whole == nullptr || full == nullptr) return OKID_ERR_NULL;
    okid_jackknife& s = *self;
    const okid_identify_config_t &mine = s.config.identify, &its = by->config;
    okid_accumulator_config_t held;
    okid_accumulator_config(whole, &held);
    s.whole = nullptr;
    if (s.config.linear == 0 || !by->from_sums || its.method != mine.method || its.hankel != mine.hankel ||
        by->n_u != mine.n_u || by->n_y != mine.n_y || by->n != s.size || its.rows != okid::plan_of(mine).config.rows ||
        held.n_u != mine.n_u || held.n_y != mine.n_y || held.lags != by->lags)
        return OKID_ERR_MISMATCH;
    if (full->n_z < 1 || full->n_z > okid_identify_max_order(&mine)) return OKID_ERR_DIM;
    okid_status_t status = okid_accumulator_energy(whole, mine.detrend, s.energy);
    if (status != OKID_OK) return status;
    if (mine.detrend != OKID_DETREND_NONE) okid_accumulator_lag_means(whole, s.mean);
    status = s.ssarx.size > 0      ? s.ssarx.begin(*by, *full)
             : s.subspace.size > 0 ? s.subspace.begin(*by, *full)
                                   : s.era.begin(*by, *full);
    if (status == OKID_OK) s.whole = whole;
    s.begun = false;
    return status;
}

okid_status_t okid_jackknife_delete(okid_jackknife_t* self, okid_accumulator_t* part, double weight,
                                    okid_model_t* model, double* share) {
    if (self == nullptr || self->whole == nullptr || model == nullptr || share == nullptr ||
        (part == nullptr && self->config.linear != 0))
        return OKID_ERR_NULL;
    okid_jackknife& s = *self;
    okid_status_t status =
        part == nullptr ? OKID_OK : okid_accumulator_energy(part, s.config.identify.detrend, s.taken);
    if (s.config.linear != 0) {
        if (status == OKID_OK)
            status = multiply_part(s, part,
                                   s.ssarx.size > 0      ? s.ssarx.asks()
                                   : s.subspace.size > 0 ? s.subspace.asks()
                                                         : s.era.asks());
        if (status != OKID_OK) return status;
        *share = share_of(s, weight);
        if (!s.begun) s.beside.begin(along(s, 0));
        s.begun = true;
        *model = s.beside.of(along(s, -weight / (1 - *share)));
        return OKID_OK;
    }
    if (status == OKID_OK) status = okid_accumulator_copy(s.rest, s.whole);
    if (status == OKID_OK && part != nullptr) status = okid_accumulator_remove(s.rest, part, weight);
    if (status != OKID_OK) return status;
    *share = part != nullptr ? share_of(s, weight) : 0;
    okid_identified_t found;
    status = okid::replicate(*s.identifier, s.rest, s.order, &found);
    if (status < 0) return status;
    *model = okid_model_t{found.n_u, found.n_y, found.n_z, found.A, found.B, found.C, found.D, nullptr};
    return OKID_OK;
}
