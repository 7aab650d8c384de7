// SPDX-License-Identifier: MIT
// PURPOSE    recursive, mergeable shift-structured Gram sums in the caller's memory
// METHOD     samples wait in x behind the last p ones; full chunks go through the kernel into the open slot; a slot is
//            closed by a gap or after `block` rows and goes to the ring (window) or into the base sums (growing)
// REFERENCE  paper eq. (36)-(38) without the zero columns; shift structure: docs/numerics.md
// NUMERICS   codes: exact, bounds in accumulator.h; doubles: plain sums, independent of how calls cut the record
// WORKSPACE  all in the block; add() touches the open slot and x only
#include "accumulator.h"

#include <math.h>
#include <string.h>

enum { ALIGN = 16, CHUNK = 256, FOLD_ROWS = 1 << 22 };
static const int64_t MAX_ROWS_I16 = INT64_C(1) << 32;

static size_t aligned(size_t bytes) { return (bytes + ALIGN - 1) & ~(size_t)(ALIGN - 1); }

static int valid(const okid_accumulator_config_t* c) {
    if (c->n_u < 0 || c->n_y < 1 || c->n_u > 256 || c->n_y > 256 || c->n_u + c->n_y > 256) return 0;
    if (c->lags < 1 || c->lags > 4096) return 0;
    if (c->sample != OKID_SAMPLE_DOUBLE && c->sample != OKID_SAMPLE_INT16) return 0;
    if (c->block < 0 || c->slots < 0 || c->spare_slots < 0 || c->slots > 65536 || c->spare_slots > 65536) return 0;
    if (!(c->forgetting > 0 && c->forgetting <= 1)) return 0;
    if (c->slots > 0 && (c->block == 0 || c->forgetting < 1)) return 0;
    if (c->forgetting < 1 && (c->block == 0 || !c->edges)) return 0;
    return !(c->block > 0 && c->slots == 0 && !c->edges);
}

/// Offsets of everything behind the struct; returns the total number of bytes.
static size_t lay_out(okid_accumulator_t* a) {
    const okid_accumulator_config_t* c = &a->config;
    const size_t m = (size_t)a->m, p = (size_t)c->lags, pm = p * m, sums = m * m * (p + 1), number = sizeof(double);
    const int ring = c->slots > 0, base = !ring && c->edges;
    size_t at = aligned(sizeof *a);
    a->scale_at = at;
    at = aligned(at + 2 * m * number);
    a->x_at = at;
    at = aligned(at + (pm + CHUNK * m) * number);
    a->sums_at = at;
    at = aligned(at + (pm + m) * number);
    a->partial_at = at;
    at = aligned(at + (c->sample == OKID_SAMPLE_INT16 ? sums * number : 0));
    a->slot_head = sums + m;
    a->slot_tail = a->slot_head + pm;
    a->slot_bytes = aligned(sizeof(slot_info_t) + (a->slot_tail + (ring || base ? pm : 0)) * number);
    a->slot_count = ring ? c->slots + c->spare_slots + 1 : 1;
    a->slots_at = at;
    at += a->slot_bytes * (size_t)a->slot_count;
    a->base_at = at;
    at = aligned(at + (base ? (sums + m + pm + pm * (pm + 1) / 2) * number : 0));
    return at;
}

size_t okid_accumulator_memsize(const okid_accumulator_config_t* config) {
    if (!config || !valid(config)) return 0;
    okid_accumulator_t a;
    memset(&a, 0, sizeof a);
    a.config = *config;
    a.m = config->n_u + config->n_y;
    return lay_out(&a) + ALIGN;
}

okid_status_t okid_accumulator_create(okid_accumulator_t** self, const okid_accumulator_config_t* config, void* block,
                                      size_t bytes) {
    if (!self || !config || !block) return OKID_ERR_NULL;
    if (!valid(config)) return OKID_ERR_DIM;
    if (bytes < okid_accumulator_memsize(config)) return OKID_ERR_MEMORY;
    okid_accumulator_t* a = (okid_accumulator_t*)aligned((size_t)block);
    memset(a, 0, sizeof *a);
    a->config = *config;
    a->m = config->n_u + config->n_y;
    a->width = a->m * (config->lags + 1);
    const size_t size = lay_out(a);
    memset((char*)a + sizeof *a, 0, size - sizeof *a);
    for (int32_t r = 0; r < a->m; ++r) acc_scale(a)[r] = 1;
    a->kernel = okid_kernel_pick();
    *self = a;
    return OKID_OK;
}

void okid_accumulator_reset(okid_accumulator_t* self) {
    const size_t size = lay_out(self), from = self->x_at;
    memset((char*)self + from, 0, size - from);
    memset(&self->stats, 0, sizeof self->stats);
    self->base_weight = 0;
    self->clock = 0;
    self->have = self->pending = self->open = self->closed = 0;
}

void okid_accumulator_set_units(okid_accumulator_t* self, const double* scale, const double* offset) {
    for (int32_t r = 0; r < self->m; ++r) {
        acc_scale(self)[r] = scale[r];
        acc_scale(self)[self->m + r] = offset ? offset[r] : 0;
    }
}

/// Move the exact double sums of the kernel into the 64-bit sums of the open slot.
static void fold_partial(okid_accumulator_t* a) {
    if (a->config.sample != OKID_SAMPLE_INT16 || a->partial_rows == 0) return;
    double* partial = acc_partial(a);
    int64_t* sums = (int64_t*)acc_slot_data(a, a->open);
    const size_t count = (size_t)a->m * (size_t)a->width;
    for (size_t i = 0; i < count; ++i) sums[i] += (int64_t)partial[i];
    memset(partial, 0, count * sizeof *partial);
    a->partial_rows = 0;
}

/// Run the kernel over the samples that wait and keep the last p of them as the lag window.
static void flush(okid_accumulator_t* a) {
    if (a->pending == 0) return;
    const int32_t m = a->m, p = a->config.lags, count = a->pending;
    double* x = acc_x(a);
    slot_info_t* slot = acc_slot(a, a->open);
    double* data = acc_slot_data(a, a->open);
    if (slot->rows == 0) memcpy(data + a->slot_head, x, (size_t)(p * m) * sizeof *x);
    double* sums = data;
    if (a->config.sample == OKID_SAMPLE_INT16) {
        if (a->partial_rows + count > FOLD_ROWS) fold_partial(a);
        sums = acc_partial(a);
        a->partial_rows += count;
    }
    a->kernel(sums, x, m, p, count);
    double* mean = data + (size_t)m * (size_t)a->width;
    for (int32_t n = 0; n < count; ++n)
        for (int32_t r = 0; r < m; ++r) mean[r] += x[(p + n) * m + r];
    memmove(x, x + (size_t)count * (size_t)m, (size_t)(p * m) * sizeof *x);
    slot->rows += count;
    a->pending = 0;
}

/// base = weight * base + open slot, with the edges of the slot.
static void fold_slot_into_base(okid_accumulator_t* a, double weight) {
    const int32_t m = a->m, p = a->config.lags;
    const size_t pm = (size_t)p * (size_t)m, sums = (size_t)m * (size_t)a->width;
    const double* data = acc_slot_data(a, a->open);
    const double *head = data + a->slot_head, *tail = data + a->slot_tail;
    double* base = acc_base(a);
    const int integer_base = acc_base_is_integer(a), integer_slot = a->config.sample == OKID_SAMPLE_INT16;
    if (weight != 1)
        for (size_t i = 0; i < sums + m + pm + pm * (pm + 1) / 2; ++i) base[i] *= weight;
    for (size_t i = 0; i < sums; ++i) {
        if (integer_base)
            ((int64_t*)base)[i] += ((const int64_t*)data)[i];
        else
            base[i] += integer_slot ? (double)((const int64_t*)data)[i] : data[i];
    }
    double *mean = base + sums, *edge_mean = mean + m, *edge = edge_mean + pm;
    for (int32_t r = 0; r < m; ++r) mean[r] += data[sums + (size_t)r];
    for (size_t j = 0; j < pm; ++j) {
        const double hj = acc_lag(head, j, m, p), tj = acc_lag(tail, j, m, p);
        edge_mean[j] += hj - tj;
        for (size_t i = 0; i <= j; ++i) {
            const double e = acc_lag(head, i, m, p) * hj - acc_lag(tail, i, m, p) * tj;
            if (integer_base)
                ((int64_t*)edge)[j * (j + 1) / 2 + i] += (int64_t)e;
            else
                edge[j * (j + 1) / 2 + i] += e;
        }
    }
    a->base_weight = a->base_weight * weight + (double)acc_slot(a, a->open)->rows;
}

/// Window: drop the oldest closed slot.
static void drop_oldest(okid_accumulator_t* a) {
    a->stats.rows -= acc_slot(a, acc_oldest(a))->rows;
    a->closed -= 1;
}

static void clear_slot(okid_accumulator_t* a, int32_t index, int joined) {
    slot_info_t* slot = acc_slot(a, index);
    memset(slot, 0, a->slot_bytes);
    slot->joined = joined;
    slot->start = a->clock - a->pending;
}

/// End the open slot. `joined`: the next one continues the same run.
static void close_slot(okid_accumulator_t* a, int joined) {
    flush(a);
    fold_partial(a);
    slot_info_t* slot = acc_slot(a, a->open);
    const okid_accumulator_config_t* c = &a->config;
    if (slot->rows == 0) {
        clear_slot(a, a->open, joined);
        return;
    }
    if (c->slots == 0 && !c->edges) return; // stays until another run needs the place
    memcpy(acc_slot_data(a, a->open) + a->slot_tail, acc_x(a), (size_t)(c->lags * a->m) * sizeof(double));
    if (c->slots == 0) {
        fold_slot_into_base(a, c->forgetting < 1 ? pow(c->forgetting, (double)slot->rows) : 1);
        clear_slot(a, a->open, joined);
        return;
    }
    a->closed += 1;
    a->open = (a->open + 1) % a->slot_count;
    const int64_t window = (int64_t)c->slots * c->block;
    while (a->closed == a->slot_count || (a->closed > 0 && a->clock - acc_slot(a, acc_oldest(a))->start > window))
        drop_oldest(a);
    clear_slot(a, a->open, joined);
}

/// A run ends: what comes next has no known past.
static void end_run(okid_accumulator_t* a) {
    close_slot(a, 0);
    a->have = 0;
}

void okid_accumulator_gap(okid_accumulator_t* self, int64_t count) {
    if (self->have > 0 || self->in_gap == 0) {
        end_run(self);
        self->stats.gaps += count > 0;
    }
    self->in_gap = 1;
    self->stats.missing += count;
    self->clock += count;
    slot_info_t* slot = acc_slot(self, self->open);
    if (slot->rows == 0) slot->start = self->clock;
}

/// A second run begins where there is no room for the ends of the first: the first is dropped, and counted.
static void make_room(okid_accumulator_t* a) {
    const slot_info_t* slot = acc_slot(a, a->open);
    a->stats.dropped += slot->rows;
    a->stats.rows -= slot->rows;
    clear_slot(a, a->open, 0);
}

/// Take up to `count` samples of one run; returns how many were taken. Source is one of doubles or codes.
static size_t feed(okid_accumulator_t* a, const double* samples, const int16_t* codes, size_t count) {
    const int32_t m = a->m, p = a->config.lags;
    size_t room;
    double* to;
    if (a->have < p) {
        room = (size_t)(p - a->have);
        to = acc_x(a) + (size_t)(a->have * m);
    } else {
        const int64_t left = a->config.block > 0 ? a->config.block - acc_slot(a, a->open)->rows : CHUNK;
        room = (size_t)((left < CHUNK ? left : CHUNK) - a->pending);
        to = acc_x(a) + (size_t)((p + a->pending) * m);
    }
    if (count > room) count = room;
    const size_t numbers = count * (size_t)m;
    if (samples)
        memcpy(to, samples, numbers * sizeof *to);
    else
        for (size_t i = 0; i < numbers; ++i) to[i] = codes[i];
    a->clock += (int64_t)count;
    a->in_gap = 0;
    if (a->have < p) {
        a->have += (int32_t)count;
        slot_info_t* slot = acc_slot(a, a->open);
        if (slot->rows == 0) slot->start = a->clock;
        return count;
    }
    a->pending += (int32_t)count;
    a->stats.rows += (int64_t)count;
    if (a->config.block > 0 && acc_slot(a, a->open)->rows + a->pending == a->config.block)
        close_slot(a, 1);
    else if (a->pending == CHUNK)
        flush(a);
    return count;
}

static void feed_run(okid_accumulator_t* a, const double* samples, const int16_t* codes, size_t count) {
    if (count > 0 && a->in_gap && a->config.slots == 0 && !a->config.edges) make_room(a);
    a->stats.samples += (int64_t)count;
    while (count > 0) {
        const size_t taken = feed(a, samples, codes, count), numbers = taken * (size_t)a->m;
        if (samples)
            samples += numbers;
        else
            codes += numbers;
        count -= taken;
    }
}

static int finite_sample(const double* v, size_t numbers) {
    double sum = 0;
    for (size_t i = 0; i < numbers; ++i) sum += v[i] * 0.0;
    return sum == 0;
}

okid_status_t okid_accumulator_add(okid_accumulator_t* self, const double* samples, size_t count) {
    if (!self || (!samples && count > 0)) return OKID_ERR_NULL;
    if (self->config.sample != OKID_SAMPLE_DOUBLE) return OKID_ERR_MISMATCH;
    const size_t m = (size_t)self->m;
    okid_status_t status = OKID_OK;
    for (size_t i = 0; i < count;) {
        size_t run = count - i < CHUNK ? count - i : CHUNK;
        if (!finite_sample(samples + i * m, run * m)) // rare: find where it ends
            for (run = 0; finite_sample(samples + (i + run) * m, m);) ++run;
        feed_run(self, samples + i * m, NULL, run);
        i += run;
        if (i < count && !finite_sample(samples + i * m, m)) {
            okid_accumulator_gap(self, 1);
            status = OKID_WARN_MISSING;
            ++i;
        }
    }
    return status;
}

okid_status_t okid_accumulator_add_i16(okid_accumulator_t* self, const int16_t* codes, size_t count) {
    if (!self || (!codes && count > 0)) return OKID_ERR_NULL;
    if (self->config.sample != OKID_SAMPLE_INT16) return OKID_ERR_MISMATCH;
    if (self->config.slots == 0 && self->config.forgetting >= 1 && self->stats.rows + (int64_t)count > MAX_ROWS_I16)
        return OKID_ERR_RANGE;
    int64_t saturated = 0;
    const size_t numbers = count * (size_t)self->m;
    for (size_t i = 0; i < numbers; ++i) saturated += codes[i] == INT16_MAX || codes[i] == INT16_MIN;
    self->stats.saturated += saturated;
    feed_run(self, NULL, codes, count);
    return saturated ? OKID_WARN_SATURATED : OKID_OK;
}

/// The open slot of `other` becomes a closed record of `self`.
static void adopt_open_slot(okid_accumulator_t* self, okid_accumulator_t* other) {
    if (acc_slot(other, other->open)->rows == 0) return;
    memcpy(acc_slot(self, self->open), acc_slot(other, other->open), self->slot_bytes);
    memcpy(acc_slot_data(self, self->open) + self->slot_tail, acc_x(other),
           (size_t)(self->config.lags * self->m) * sizeof(double));
    fold_slot_into_base(self, 1);
    clear_slot(self, self->open, 0);
}

okid_status_t okid_accumulator_merge(okid_accumulator_t* self, okid_accumulator_t* other) {
    if (!self || !other) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &other->config;
    if (a->n_u != b->n_u || a->n_y != b->n_y || a->lags != b->lags || a->sample != b->sample || !a->edges ||
        !b->edges || a->slots || b->slots || a->forgetting != 1 || b->forgetting != 1 || self == other)
        return OKID_ERR_MISMATCH;
    if (a->sample == OKID_SAMPLE_INT16 && self->stats.rows + other->stats.rows > MAX_ROWS_I16) return OKID_ERR_RANGE;
    end_run(self);
    flush(other);
    fold_partial(other);
    const size_t m = (size_t)self->m, pm = m * (size_t)a->lags, sums = m * (size_t)self->width;
    const size_t mean = sums, edge = sums + m + pm, end = edge + pm * (pm + 1) / 2;
    double *to = acc_base(self), *from = acc_base(other);
    const int integer = acc_base_is_integer(self);
    for (size_t i = 0; i < end; ++i) {
        const int is_mean = i >= mean && i < edge;
        if (integer && !is_mean)
            ((int64_t*)to)[i] += ((const int64_t*)from)[i];
        else
            to[i] += from[i];
    }
    self->base_weight += other->base_weight;
    adopt_open_slot(self, other);
    self->stats.samples += other->stats.samples;
    self->stats.missing += other->stats.missing;
    self->stats.gaps += other->stats.gaps;
    self->stats.saturated += other->stats.saturated;
    self->stats.rows += other->stats.rows;
    self->clock += other->clock;
    return OKID_OK;
}

void okid_accumulator_stats(const okid_accumulator_t* self, okid_accumulator_stats_t* out) { *out = self->stats; }
void okid_accumulator_config(const okid_accumulator_t* self, okid_accumulator_config_t* out) { *out = self->config; }
int64_t okid_accumulator_rows(const okid_accumulator_t* self) { return self->stats.rows; }

void okid_accumulator_settle(okid_accumulator_t* self) {
    flush(self);
    fold_partial(self);
}
