// SPDX-License-Identifier: MIT
// PURPOSE    correlations with past inputs to many lags, in the caller's memory: layout, samples, gaps, merging
// METHOD     the kernel of the accumulator on the lag windows of the inputs and, to few lags, of the outputs
// REFERENCE  docs/numerics.md, refinement from sums
// NUMERICS   codes: products of 32 bits in 64-bit sums, folded into pairs every 2^16 rows (int16: 2^32; int32: added to pairs one
//            by one); doubles: plain sums in the order of the samples
// WORKSPACE  none; 2 (m + n_u) n_u (L + 1) flop a sample, less by transforms (correlation_spectrum.c)
#include "correlation.h"
#include "counts.h"
#include "kernel.h"
#include "source.h"
#include "spectrum.h"

enum { ALIGN = 16, BUFFER = 256, MOST_LAGS = 65536, MOST_OWN = 256, MOST_SLOTS = 4096 };

static int valid(const okid_correlation_config_t* c) {
    if (c->n_u < 1 || c->n_y < 1 || c->n_u > 256 || c->n_y > 256 || c->n_u + c->n_y > 256) return 0;
    if (c->lags < 1 || c->lags > MOST_LAGS || c->own_lags < 0 || c->own_lags > c->lags || c->own_lags > MOST_OWN)
        return 0;
    if ((unsigned)c->sample > OKID_SAMPLE_INT32 || c->block < 0 || c->buffer < 0 || c->buffer > 65536) return 0;
    if (c->slots < 1 || c->slots > MOST_SLOTS || !(c->forgetting > 0 && c->forgetting <= 1)) return 0;
    return c->forgetting >= 1 || c->block > 0;
}

static uint32_t take(uint64_t* at, uint64_t numbers) {
    const uint64_t here = *at;
    *at += (numbers + 1) & ~(uint64_t)1;
    return (uint32_t)here;
}

/// Place everything behind the struct; returns the total in numbers, 0 when places leave 32 bits.
static uint64_t lay_out(okid_correlation_t* s, const okid_correlation_config_t* config) {
    memset(s, 0, sizeof *s);
    s->config = *config;
    s->points = okid_correlation_points(config);
    s->buffer = config->buffer > 0 ? config->buffer : s->points > 0 ? s->points - config->lags : BUFFER;
    s->m = config->n_u + config->n_y;
    s->ring = config->slots + (config->block > 0);
    const uint64_t rows = (uint64_t)s->buffer;
    uint64_t at = 0;
    take(&at, (sizeof *s + 7) / 8);
    s->scale_at = take(&at, (uint64_t)s->m);
    s->tables_at = take(&at, 2 * (uint64_t)s->points);
    s->now_at = take(&at, rows * (uint64_t)s->m);
    s->u_at = take(&at, cor_u_window(s) + rows * (uint64_t)config->n_u);
    s->y_at = take(&at, cor_y_window(s) + rows * (uint64_t)config->n_y);
    s->slot_numbers = (uint32_t)(sizeof(cor_slot_t) / 8 + 2 * cor_end_count(s));
    s->slots_at = take(&at, (uint64_t)s->slot_numbers * (uint64_t)s->ring);
    s->sums_numbers = (uint32_t)(cor_sum_count(s) * (size_t)cor_planes(s) + (size_t)s->m);
    s->sums_at = take(&at, (uint64_t)s->sums_numbers * (uint64_t)cor_sets(s));
    s->spectrum_at = take(&at, okid_correlation_spectrum_numbers(s));
    s->kept_at = take(&at, s->points > 0 && !cor_codes(s) ? s->sums_numbers : 0);
    return at <= UINT32_MAX ? at : 0;
}

size_t okid_correlation_memsize(const okid_correlation_config_t* config) {
    if (!config || !valid(config)) return 0;
    okid_correlation_t s;
    const uint64_t numbers = lay_out(&s, config);
    return numbers == 0 || numbers > SIZE_MAX / 8 - ALIGN ? 0 : (size_t)numbers * 8 + ALIGN;
}

okid_status_t okid_correlation_create(okid_correlation_t** self, const okid_correlation_config_t* config, void* block,
                                      size_t bytes) {
    if (!self || !config || !block) return OKID_ERR_NULL;
    const size_t needed = okid_correlation_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid_correlation_t* s = (okid_correlation_t*)(((size_t)block + ALIGN - 1) & ~(size_t)(ALIGN - 1));
    const size_t size = (size_t)lay_out(s, config) * 8;
    memset((char*)s + sizeof *s, 0, size - sizeof *s);
    for (int32_t r = 0; r < s->m; ++r) cor_scale(s)[r] = 1;
#ifndef OKID_INTEGER_KERNEL
    double* tables = &cor_at(s, s->tables_at)->real;
    if (s->points > 0) okid_spectrum_tables(s->points, tables, tables + s->points);
#endif
    *self = s;
    return OKID_OK;
}

void okid_correlation_reset(okid_correlation_t* self) {
    if (!self) return;
    const okid_correlation_config_t config = self->config;
    const size_t size = (size_t)lay_out(self, &config) * 8, from = 8 * (size_t)self->now_at;
    memset((char*)self + from, 0, size - from);
}

void okid_correlation_set_units(okid_correlation_t* self, const double* scale) {
    if (!self || !scale) return;
    memcpy(cor_scale(self), scale, (size_t)self->m * sizeof *scale);
}

/// Low words of the open set below 2^48, the rest in the high words.
static void fold(okid_correlation_t* s) {
    if (s->unfolded == 0) return;
    const size_t count = cor_sum_count(s);
    cor_number_t *low = cor_sums(s, s->closed), *high = low + count;
    for (size_t i = 0; i < count; ++i) {
        high[i].code += low[i].code >> WIDE_BITS;
        low[i].code &= WIDE_MASK;
    }
    s->unfolded = 0;
}

/// Rows of the buffer into one band of sums: m channels of `now` with the lags of the w channels of `window`.
static void sum_band(const okid_correlation_t* s, cor_number_t* sums, const cor_number_t* now, int m,
                     const cor_number_t* window, int w, int p) {
    if (cor_codes(s)) {
        int64_t* high = s->config.sample == OKID_SAMPLE_INT32 ? &sums[cor_sum_count(s)].code : NULL;
        okid_kernel_integer(&sums->code, high, &now->code, &window->code, m, w, p, s->pending);
    } else {
        okid_kernel_pick()(&sums->real, &now->real, &window->real, m, w, p, s->pending, p + s->pending);
    }
}

/// The lag windows behind `rows` of the samples that wait.
static void keep_end(const okid_correlation_t* s, int32_t rows, cor_number_t* to) {
    memcpy(to, cor_at(s, s->u_at) + rows * s->config.n_u, cor_u_window(s) * sizeof *to);
    memcpy(to + cor_u_window(s), cor_at(s, s->y_at) + rows * s->config.n_y, cor_y_window(s) * sizeof *to);
}

/// Sum the samples that wait.
static void sum_pending(okid_correlation_t* s) {
    cor_slot_t* slot = cor_slot(s, s->closed);
    if (slot->rows == 0) keep_end(s, 0, cor_head(s, s->closed));
    if (cor_codes(s) && s->config.sample != OKID_SAMPLE_INT32) {
        const int64_t limit = s->config.sample == OKID_SAMPLE_INT16 ? INT64_C(1) << 32 : INT64_C(1) << 16;
        if (s->unfolded + s->pending > limit - 1) fold(s); // the low words hold less than 2^48 to begin with
        s->unfolded += s->pending;
    }
    cor_number_t *sums = cor_sums(s, s->closed), *u = cor_at(s, s->u_at), *y = cor_at(s, s->y_at);
    const cor_number_t* now = cor_at(s, s->now_at);
    const int32_t n_u = s->config.n_u;
    sum_band(s, sums + cor_u_count(s), now, s->m, y, s->config.n_y, s->config.own_lags);
    if (!okid_correlation_gather(s)) {
        sum_band(s, sums, now, s->m, u, n_u, s->config.lags);
        sum_band(s, sums + cor_t_at(s), u, n_u, u, n_u,
                 s->config.lags); // the oldest input of each window with all of it
    }
    if (!cor_codes(s)) okid_correlation_bring_out(s);
    cor_number_t* sum = sums + cor_sum_count(s) * (size_t)cor_planes(s);
    for (int32_t n = 0; n < s->pending; ++n, now += s->m)
        for (int32_t r = 0; r < s->m; ++r) {
            if (cor_codes(s))
                sum[r].code += now[r].code;
            else
                sum[r].real += now[r].real;
        }
    slot->rows += s->pending;
}

/// Sum the samples that wait; what of them the next lag windows need moves to the front.
static void flush(okid_correlation_t* s) {
    if (s->pending == 0) return;
    sum_pending(s);
    cor_number_t *u = cor_at(s, s->u_at), *y = cor_at(s, s->y_at);
    memmove(u, u + (size_t)s->pending * (size_t)s->config.n_u, cor_u_window(s) * sizeof *u);
    memmove(y, y + (size_t)s->pending * (size_t)s->config.n_y, cor_y_window(s) * sizeof *y);
    s->pending = 0;
}

void okid_correlation_settle(okid_correlation_t* self) {
    if (self->closed == self->ring) return;
    flush(self);
    okid_correlation_bring_out(self);
    fold(self);
    if (cor_slot(self, self->closed)->rows > 0) keep_end(self, 0, cor_tail(self, self->closed));
}

void okid_correlation_begin_look(okid_correlation_t* self) {
    if (self->points == 0 || cor_codes(self) || self->pending == 0) {
        okid_correlation_settle(self);
        return;
    }
    memcpy(cor_at(self, self->kept_at), cor_sums(self, self->closed), self->sums_numbers * sizeof(cor_number_t));
    sum_pending(self);
    keep_end(self, self->pending, cor_tail(self, self->closed));
}

void okid_correlation_end_look(okid_correlation_t* self) {
    if (self->points == 0 || cor_codes(self) || self->pending == 0) return;
    memcpy(cor_sums(self, self->closed), cor_at(self, self->kept_at), self->sums_numbers * sizeof(cor_number_t));
    cor_slot(self, self->closed)->rows -= self->pending;
}

/// End the open slot; the oldest falls out of a full window.
static void close_slot(okid_correlation_t* s) {
    okid_correlation_settle(s);
    if (s->closed == s->ring || cor_slot(s, s->closed)->rows == 0) return;
    ++s->closed;
    if (s->config.block > 0 && s->closed == s->ring) {
        s->stats.rows -= cor_slot(s, 0)->rows;
        s->oldest = cor_index(s, 1);
        --s->closed;
    }
    if (s->closed == s->ring) return;
    cor_slot(s, s->closed)->rows = 0;
    if (s->config.block > 0) memset(cor_sums(s, s->closed), 0, s->sums_numbers * sizeof(cor_number_t));
}

void okid_correlation_gap(okid_correlation_t* self, int64_t count) {
    if (!self || count < 0) return;
    count = gap_within(count, self->clock);
    if (self->have > 0 || !self->in_gap) {
        close_slot(self);
        self->have = 0;
        self->stats.gaps += count > 0;
    }
    self->in_gap = 1;
    self->stats.missing += count;
    self->clock += count;
}

/// m numbers into a place of the lag windows; `arming` samples stand in front of the first row.
static void spread(okid_correlation_t* s, const cor_number_t* v, int32_t place) {
    const int32_t n_u = s->config.n_u, n_y = s->config.n_y, y_place = place - s->config.lags + s->config.own_lags;
    memcpy(cor_at(s, s->u_at) + (size_t)place * (size_t)n_u, v, (size_t)n_u * sizeof *v);
    if (y_place >= 0) memcpy(cor_at(s, s->y_at) + (size_t)y_place * (size_t)n_y, v + n_u, (size_t)n_y * sizeof *v);
}

/// Take up to `count` samples of one run; returns how many were taken.
static size_t feed(okid_correlation_t* s, source_t source, size_t count) {
    const int arming = s->have < s->config.lags;
    const cor_slot_t* slot = cor_slot(s, s->closed);
    int64_t room = s->buffer - s->pending;
    if (arming && room > s->config.lags - s->have) room = s->config.lags - s->have;
    if (!arming && s->config.block > 0 && room > s->config.block - slot->rows - s->pending)
        room = s->config.block - slot->rows - s->pending;
    if (count > (size_t)room) count = (size_t)room;
    const size_t m = (size_t)s->m;
    cor_number_t* now = cor_at(s, s->now_at) + (size_t)s->pending * m;
    if (cor_codes(s))
        for (size_t i = 0; i < count * m; ++i)
            now[i].code = source.kind == FROM_INT16 ? ((const int16_t*)source.at)[i] : ((const int32_t*)source.at)[i];
    else
        memcpy(now, source.at, count * m * sizeof *now);
    for (size_t n = 0; n < count; ++n)
        spread(s, now + n * m, arming ? s->have + (int32_t)n : s->config.lags + s->pending + (int32_t)n);
    s->clock += (int64_t)count;
    if (arming) {
        s->have += (int32_t)count;
        return count;
    }
    s->pending += (int32_t)count;
    s->stats.rows += (int64_t)count;
    if (s->config.block > 0 && slot->rows + s->pending == s->config.block)
        close_slot(s);
    else if (s->pending == s->buffer)
        flush(s);
    return count;
}

static void feed_run(okid_correlation_t* s, source_t source, size_t count) {
    if (count == 0) return;
    s->in_gap = 0;
    s->stats.samples += (int64_t)count;
    while (count > 0 && s->closed < s->ring) {
        const size_t taken = feed(s, source, count);
        source = advance(source, taken * (size_t)s->m);
        count -= taken;
    }
    s->stats.dropped += (int64_t)count;
    s->clock += (int64_t)count;
}

/// Feed what is usable, make gaps of the rest.
static okid_status_t feed_usable(okid_correlation_t* s, source_t source, size_t count) {
    okid_status_t status = OKID_OK;
    while (count > 0) {
        const piece_t piece = next_piece(&source, &count, s->config.sample, (size_t)s->m);
        feed_run(s, piece.source, piece.count);
        if (!piece.missing_behind) continue;
        okid_correlation_gap(s, 1);
        status = OKID_WARN_MISSING;
    }
    return status;
}

okid_status_t okid_correlation_add(okid_correlation_t* self, const double* samples, size_t count) {
    if (!self || (!samples && count > 0)) return OKID_ERR_NULL;
    if (cor_codes(self)) return OKID_ERR_MISMATCH;
    return feed_usable(self, (source_t){FROM_DOUBLE, samples}, count);
}

static okid_status_t add_codes(okid_correlation_t* self, source_t source, size_t count) {
    if (!self || (!source.at && count > 0)) return OKID_ERR_NULL;
    if (!cor_codes(self) || (source.kind == FROM_INT16) != (self->config.sample == OKID_SAMPLE_INT16))
        return OKID_ERR_MISMATCH;
    const codes_seen_t seen = look_at_codes(source, self->config.sample, count * (size_t)self->m);
    if (seen.outside) return OKID_ERR_RANGE;
    self->stats.saturated += seen.saturated;
    if (seen.saturated && self->config.saturated_missing)
        (void)feed_usable(self, source, count);
    else
        feed_run(self, source, count);
    return seen.saturated ? OKID_WARN_SATURATED : OKID_OK;
}

okid_status_t okid_correlation_add_i16(okid_correlation_t* self, const int16_t* codes, size_t count) {
    return add_codes(self, (source_t){FROM_INT16, codes}, count);
}

okid_status_t okid_correlation_add_i32(okid_correlation_t* self, const int32_t* codes, size_t count) {
    return add_codes(self, (source_t){FROM_INT32, codes}, count);
}

okid_status_t okid_correlation_merge(okid_correlation_t* self, okid_correlation_t* other) {
    if (!self || !other) return OKID_ERR_NULL;
    const okid_correlation_config_t *a = &self->config, *b = &other->config;
    if (self == other || a->block > 0 || b->block > 0 || a->n_u != b->n_u || a->n_y != b->n_y || a->lags != b->lags ||
        a->own_lags != b->own_lags || a->sample != b->sample)
        return OKID_ERR_MISMATCH;
    okid_correlation_settle(other);
    okid_correlation_settle(self);
    const int32_t own = cor_pieces(self), theirs = cor_pieces(other);
    if (own + theirs > self->ring ||
        !counts_fit(&self->stats, &other->stats, row_limit(a->sample), self->clock, other->clock))
        return OKID_ERR_RANGE;
    okid_correlation_gap(self, 0);
    for (int32_t k = 0; k < theirs; ++k) {
        memcpy(cor_slot(self, self->closed), cor_slot(other, k), self->slot_numbers * sizeof(cor_number_t));
        ++self->closed;
    }
    if (self->closed < self->ring) cor_slot(self, self->closed)->rows = 0;
    const size_t count = cor_sum_count(self), m = (size_t)self->m;
    cor_number_t *to = cor_sums(self, 0), *from = cor_sums(other, 0);
    for (size_t i = 0; i < count; ++i) {
        if (cor_codes(self))
            wide_add_wide(&to[count + i].code, &to[i].code, from[count + i].code, from[i].code);
        else
            to[i].real += from[i].real;
    }
    to += count * (size_t)cor_planes(self);
    from += count * (size_t)cor_planes(self);
    for (size_t r = 0; r < m; ++r) {
        if (cor_codes(self))
            to[r].code += from[r].code;
        else
            to[r].real += from[r].real;
    }
    okid_accumulator_stats_t *counts = &self->stats, *more = &other->stats;
    counts->samples += more->samples;
    counts->missing += more->missing;
    counts->gaps += more->gaps;
    counts->saturated += more->saturated;
    counts->rows += more->rows;
    counts->dropped += more->dropped;
    return OKID_OK;
}

void okid_correlation_stats(const okid_correlation_t* self, okid_accumulator_stats_t* out) {
    static const okid_accumulator_stats_t none = {0};
    if (out) *out = self ? self->stats : none;
}

void okid_correlation_config(const okid_correlation_t* self, okid_correlation_config_t* out) {
    static const okid_correlation_config_t none = {0};
    if (out) *out = self ? self->config : none;
}
