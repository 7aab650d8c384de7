// SPDX-License-Identifier: MIT
// PURPOSE    recursive, mergeable triangular factor of the regression rows in the caller's memory: what absorbs samples
// METHOD     samples wait behind the last p ones; full batches become rows [1, u_n, v_(n-1) .., y_n] and go under the factor
//            of the open slot by Householder reflectors. Slots are stacked, never subtracted: window = ring of factors
// REFERENCE  paper eq. (36)-(38) without the zero columns; Golub, Van Loan, Matrix Computations (2013) 6.5
// NUMERICS   backward stable; the reference of each channel is subtracted in double, the rest is okid_real_t
// WORKSPACE  all in the block: one triangle a slot, batch rows, p + batch samples; 2 N^2 flop a sample
#include "accumulate/square_root.hpp"
#include "accumulate/counts.h"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

using real = okid_real_t;
using std::size_t;

namespace {

constexpr size_t alignment = 64;
constexpr int32_t default_batch = 32, most_batch = 1024;
// Squares of such numbers can be added for a long time before they overflow.
const double largest = std::ldexp(1.0, std::numeric_limits<real>::max_exponent / 2 - 16);

size_t aligned(size_t bytes) { return (bytes + alignment - 1) / alignment * alignment; }

bool valid(const okid_square_root_config_t& c) {
    if (c.n_u < 0 || c.n_y < 1 || c.n_u > 256 || c.n_y > 256 || c.n_u + c.n_y > 256) return false;
    if (c.lags < 1 || c.lags > 4096 || c.batch < 0 || c.batch > most_batch) return false;
    if (c.block < 0 || c.slots < 0 || c.spare_slots < 0 || c.slots > 65536 || c.spare_slots > 65536) return false;
    if (!(c.forgetting > 0 && c.forgetting <= 1)) return false;
    if (c.slots > 0 && (c.block == 0 || c.forgetting < 1)) return false;
    if (c.forgetting < 1 && c.block == 0) return false;
    const double n = (c.n_u + c.n_y) * (c.lags + 1.0) + 3 * OKID_PANEL, triangles = 3.0 + c.slots + c.spare_slots;
    return (triangles * n * n / 2 + (most_batch + 20) * n) * sizeof(double) < static_cast<double>(PTRDIFF_MAX);
}

/// Offsets of everything behind the struct; returns the total number of bytes.
size_t lay_out(okid_square_root& a) {
    const auto m = static_cast<size_t>(a.m), n = static_cast<size_t>(a.n), p = static_cast<size_t>(a.config.lags),
               batch = static_cast<size_t>(a.config.batch);
    size_t at = aligned(sizeof a);
    auto take = [&](size_t bytes) {
        const size_t here = at;
        at = aligned(at + bytes);
        return here;
    };
    const size_t triangle = aligned(okid_triangle_size(a.stride) * sizeof(real));
    a.scale_at = take(2 * m * sizeof(double));
    a.reference_at = take(m * sizeof(double));
    a.samples_at = take((p + batch) * m * sizeof(double));
    a.window_at = take((p + batch) * m * sizeof(real));
    a.rows_at = take(batch * a.stride * sizeof(real));
    a.panel_at = take((batch + 3) * OKID_PANEL * sizeof(real));
    a.wide_at = take(std::max((OKID_PANEL + 1) * n, p) * sizeof(double));
    a.slot_bytes = aligned(sizeof(square_root_slot)) + triangle;
    a.slots_at = take(a.slot_bytes * static_cast<size_t>(a.slot_count));
    a.whole_at = take(a.slot_count > 1 ? triangle : 0);
    return at;
}

okid_square_root plan(const okid_square_root_config_t& config) {
    okid_square_root a{};
    a.config = config;
    if (config.batch == 0) a.config.batch = default_batch;
    a.m = config.n_u + config.n_y;
    a.n = a.m * (config.lags + 1);
    a.q = a.n - config.n_y;
    a.stride = okid_triangle_stride(static_cast<size_t>(a.n) + 1);
    a.slot_count = config.slots > 0 ? config.slots + config.spare_slots + 1 : config.forgetting < 1 ? 2 : 1;
    a.open = config.forgetting < 1 ? 1 : 0;
    return a;
}

void update(okid_square_root& a, real* triangle, int32_t count, size_t first) {
    okid_householder_pick()(triangle, a.stride, a.at<real>(a.rows_at), count, first, a.at<real>(a.panel_at));
}

/// Median of each channel over the samples of the first lag window: one wild sample does no harm.
void take_reference(okid_square_root& a) {
    const int32_t p = a.config.lags;
    double* sorted = a.wide();
    for (int32_t c = 0; c < a.m; ++c) {
        for (int32_t n = 0; n < p; ++n) sorted[n] = a.samples()[n * a.m + c];
        std::nth_element(sorted, sorted + p / 2, sorted + p);
        a.reference()[c] = sorted[p / 2];
    }
    a.referenced = 1;
}

/// The waiting samples as regression rows. The samples less their reference are laid out newest first, so that the lags of
/// a row are contiguous.
void fill_rows(okid_square_root& a) {
    const auto m = static_cast<size_t>(a.m), p = static_cast<size_t>(a.config.lags),
               count = static_cast<size_t>(a.pending), total = p + count, n_u = static_cast<size_t>(a.config.n_u);
    real* window = a.at<real>(a.window_at);
    const double *sample = a.samples(), *reference = a.reference();
    for (size_t t = 0; t < total; ++t, sample += m) {
        real* to = window + (total - 1 - t) * m;
        for (size_t c = 0; c < m; ++c) to[c] = static_cast<real>(sample[c] - reference[c]);
    }
    for (size_t i = 0; i < count; ++i) {
        const real *now = window + (count - 1 - i) * m, *lags = now + m;
        real *row = a.at<real>(a.rows_at) + i * a.stride, *to = row;
        *to++ = 1;
        to = std::copy(now, now + n_u, to);
        to = std::copy(lags, lags + p * m, to);
        to = std::copy(now + n_u, now + m, to);
        std::fill(to, row + a.stride, real(0));
    }
}

/// Stack the triangle `from` under `to`. `shift`: what is added to each channel of its rows, nullptr = nothing.
void stack(okid_square_root& a, real* to, const real* from, const double* shift) {
    const auto columns = static_cast<size_t>(a.n) + 1, batch = static_cast<size_t>(a.config.batch);
    for (size_t begin = 0; begin < columns; begin += batch) {
        const size_t count = std::min(batch, columns - begin), first = begin - begin % OKID_PANEL;
        real* row = a.at<real>(a.rows_at);
        for (size_t i = begin; i < begin + count; ++i, row += a.stride) {
            const real* source = from + okid_triangle_row(a.stride, i);
            const size_t panel = i - i % OKID_PANEL;
            std::fill(row + first, row + panel, real(0));
            std::copy(source + panel, source + a.stride, row + panel);
            for (int32_t k = 0; i == 0 && shift != nullptr && k < a.n; ++k)
                row[k + 1] = static_cast<real>(row[k + 1] + shift[a.channel(k)] * row[0]);
        }
        update(a, to, static_cast<int32_t>(count), first);
    }
}

void clear_slot(okid_square_root& a, int32_t index) {
    std::memset(a.slot(index), 0, a.slot_bytes);
    a.slot(index)->start = a.clock;
}

/// Forgetting: base = [lambda^(rows/2) base; open slot].
void fade_and_fold(okid_square_root& a) {
    const auto weight =
        static_cast<real>(std::sqrt(std::pow(a.config.forgetting, static_cast<double>(a.slot(a.open)->rows))));
    real* base = a.triangle(0);
    for (size_t i = 0; i < okid_triangle_size(a.stride); ++i) base[i] *= weight;
    stack(a, base, a.triangle(a.open), nullptr);
    a.slot(0)->rows += a.slot(a.open)->rows;
    a.closed = 1;
    clear_slot(a, a.open);
}

/// The run or the block ends here.
void close_slot(okid_square_root& a) {
    okid::square_root_settle(a);
    const okid_square_root_config_t& c = a.config;
    if (a.slot_count == 1) return; // one factor for everything
    if (a.slot(a.open)->rows == 0) {
        clear_slot(a, a.open);
        return;
    }
    if (c.slots == 0) {
        fade_and_fold(a);
        return;
    }
    a.closed += 1;
    a.open = (a.open + 1) % a.slot_count;
    const int64_t window = static_cast<int64_t>(c.slots) * c.block;
    while (a.closed == a.slot_count || (a.closed > 0 && a.clock - a.slot(a.oldest())->start > window)) {
        a.stats.rows -= a.slot(a.oldest())->rows;
        a.closed -= 1;
    }
    clear_slot(a, a.open);
}

/// Take up to `count` samples of one run; returns how many were taken.
template <class T> size_t feed(okid_square_root& a, const T* source, size_t count) {
    const int32_t p = a.config.lags;
    const bool arming = a.have < p;
    int64_t room = arming ? p - a.have : a.config.batch - a.pending;
    const bool blocks = a.slot_count > 1;
    if (!arming && blocks) room = std::min(room, a.config.block - a.slot(a.open)->rows - a.pending);
    count = std::min(count, static_cast<size_t>(room));
    const auto m = static_cast<size_t>(a.m), at = static_cast<size_t>(arming ? a.have : p + a.pending);
    std::copy(source, source + count * m, a.samples() + at * m);
    a.clock += static_cast<int64_t>(count);
    a.in_gap = 0;
    if (arming) {
        a.have += static_cast<int32_t>(count);
        if (a.have == p && a.referenced == 0) take_reference(a);
        if (a.slot(a.open)->rows == 0) a.slot(a.open)->start = a.clock;
        return count;
    }
    a.pending += static_cast<int32_t>(count);
    a.stats.rows += static_cast<int64_t>(count);
    if (blocks && a.slot(a.open)->rows + a.pending == a.config.block)
        close_slot(a);
    else if (a.pending == a.config.batch)
        okid::square_root_settle(a);
    return count;
}

template <class T> void feed_run(okid_square_root& a, const T* samples, size_t count) {
    a.stats.samples += static_cast<int64_t>(count);
    while (count > 0) {
        const size_t taken = feed(a, samples, count);
        samples += taken * static_cast<size_t>(a.m);
        count -= taken;
    }
}

template <class T> okid_status_t add_numbers(okid_square_root* self, const T* samples, size_t count) {
    if (self == nullptr || (samples == nullptr && count > 0)) return OKID_ERR_NULL;
    const auto m = static_cast<size_t>(self->m);
    auto usable = [&](size_t i) {
        const T* v = samples + i * m;
        return std::all_of(v, v + m, [](T x) { return std::abs(static_cast<double>(x)) <= largest; });
    };
    okid_status_t status = OKID_OK;
    for (size_t i = 0; i < count;) {
        size_t end = i;
        while (end < count && usable(end)) ++end;
        feed_run(*self, samples + i * m, end - i);
        i = end;
        if (i < count) {
            okid_square_root_gap(self, 1);
            status = OKID_WARN_MISSING;
            ++i;
        }
    }
    return status;
}

template <class T> okid_status_t add_codes(okid_square_root* self, const T* codes, size_t count) {
    if (self == nullptr || (codes == nullptr && count > 0)) return OKID_ERR_NULL;
    using range = std::numeric_limits<T>;
    const auto saturated = std::count_if(codes, codes + count * static_cast<size_t>(self->m),
                                         [](T x) { return x == range::max() || x == range::min(); });
    self->stats.saturated += saturated;
    feed_run(*self, codes, count);
    return saturated > 0 ? OKID_WARN_SATURATED : OKID_OK;
}

} // namespace

okid_real_t* okid_square_root::triangle(int32_t index) {
    return at<real>(slots_at + slot_bytes * static_cast<size_t>(index) + aligned(sizeof(square_root_slot)));
}

void okid::square_root_settle(okid_square_root& a) {
    if (a.pending == 0) return;
    const auto m = static_cast<size_t>(a.m), keep = m * static_cast<size_t>(a.config.lags);
    fill_rows(a);
    update(a, a.triangle(a.open), a.pending, 0);
    const double* from = a.samples() + m * static_cast<size_t>(a.pending);
    std::memmove(a.samples(), from, keep * sizeof(double));
    a.slot(a.open)->rows += a.pending;
    a.pending = 0;
}

const okid_real_t* okid::square_root_whole(okid_square_root& a) {
    square_root_settle(a);
    real* whole = a.at<real>(a.whole_at);
    const real* only = nullptr;
    int32_t found = 0;
    for (int32_t k = 0; k <= a.closed; ++k) {
        const int32_t index = (a.oldest() + k) % a.slot_count;
        if (a.slot(index)->rows == 0) continue;
        if (++found == 1) {
            only = a.triangle(index);
            continue;
        }
        if (found == 2) std::copy(only, only + okid_triangle_size(a.stride), whole);
        stack(a, whole, a.triangle(index), nullptr);
    }
    return found > 1 ? whole : only;
}

size_t okid_square_root_memsize(const okid_square_root_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_square_root a = plan(*config);
    return lay_out(a) + alignment;
}

okid_status_t okid_square_root_create(okid_square_root_t** self, const okid_square_root_config_t* config, void* block,
                                      size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_square_root_memsize(config)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up(); // for the Gram matrix
    auto* a = reinterpret_cast<okid_square_root*>(aligned(reinterpret_cast<size_t>(block)));
    *a = plan(*config);
    std::memset(a + 1, 0, lay_out(*a) - sizeof *a);
    std::fill(a->scale(), a->scale() + a->m, 1.0);
    *self = a;
    return OKID_OK;
}

void okid_square_root_reset(okid_square_root_t* self) {
    if (self == nullptr) return;
    *self = plan(self->config);
    const size_t size = lay_out(*self);
    std::memset(self->reference(), 0, size - self->reference_at);
}

void okid_square_root_set_units(okid_square_root_t* self, const double* scale, const double* offset) {
    if (self == nullptr || scale == nullptr) return;
    for (int32_t c = 0; c < self->m; ++c) {
        self->scale()[c] = scale[c];
        self->scale()[self->m + c] = offset != nullptr ? offset[c] : 0;
    }
}

okid_status_t okid_square_root_add(okid_square_root_t* self, const double* samples, size_t count) {
    return add_numbers(self, samples, count);
}

okid_status_t okid_square_root_add_f32(okid_square_root_t* self, const float* samples, size_t count) {
    return add_numbers(self, samples, count);
}

okid_status_t okid_square_root_add_i16(okid_square_root_t* self, const int16_t* codes, size_t count) {
    return add_codes(self, codes, count);
}

okid_status_t okid_square_root_add_i32(okid_square_root_t* self, const int32_t* codes, size_t count) {
    return add_codes(self, codes, count);
}

void okid_square_root_gap(okid_square_root_t* self, int64_t count) {
    if (self == nullptr || count < 0) return;
    count = gap_within(count, self->clock);
    if (self->have > 0 || self->in_gap == 0) {
        close_slot(*self);
        self->have = 0;
        self->stats.gaps += count > 0;
    }
    self->in_gap = 1;
    self->stats.missing += count;
    self->clock += count;
    if (self->slot(self->open)->rows == 0) self->slot(self->open)->start = self->clock;
}

okid_status_t okid_square_root_merge(okid_square_root_t* self, okid_square_root_t* other) {
    if (self == nullptr || other == nullptr) return OKID_ERR_NULL;
    const okid_square_root_config_t &a = self->config, &b = other->config;
    if (a.n_u != b.n_u || a.n_y != b.n_y || a.lags != b.lags || self->slot_count != 1 || other->slot_count != 1 ||
        self == other)
        return OKID_ERR_MISMATCH;
    if (!counts_fit(&self->stats, &other->stats, OKID_MOST_SAMPLES, self->clock, other->clock)) return OKID_ERR_RANGE;
    close_slot(*self);
    self->have = 0;
    self->in_gap = 1;
    okid::square_root_settle(*other);
    double *reference = self->reference(), *shift = self->wide();
    if (self->referenced == 0) std::copy(other->reference(), other->reference() + other->m, reference);
    self->referenced |= other->referenced;
    for (int32_t c = 0; c < self->m; ++c) shift[c] = other->reference()[c] - reference[c];
    if (other->slot(0)->rows > 0) stack(*self, self->triangle(0), other->triangle(0), shift);
    self->slot(0)->rows += other->slot(0)->rows;
    self->stats.samples += other->stats.samples;
    self->stats.missing += other->stats.missing;
    self->stats.gaps += other->stats.gaps;
    self->stats.saturated += other->stats.saturated;
    self->stats.rows += other->stats.rows;
    self->clock += other->clock;
    return OKID_OK;
}

void okid_square_root_stats(const okid_square_root_t* self, okid_accumulator_stats_t* out) {
    if (out != nullptr) *out = self != nullptr ? self->stats : okid_accumulator_stats_t{};
}

void okid_square_root_config(const okid_square_root_t* self, okid_square_root_config_t* out) {
    if (out != nullptr) *out = self != nullptr ? self->config : okid_square_root_config_t{};
}

int64_t okid_square_root_rows(const okid_square_root_t* self) { return self != nullptr ? self->stats.rows : 0; }
