// SPDX-License-Identifier: MIT
// PURPOSE    recursive, mergeable shift-structured Gram sums in the caller's memory: the per-sample part
// METHOD     samples wait in x behind the last p ones; full chunks go through the kernel into the open slot
// REFERENCE  paper eq. (36)-(38) without the zero columns; shift structure: docs/numerics.md
// NUMERICS   codes: exact, bounds in the public header; doubles: plain sums, independent of how calls cut the record
// WORKSPACE  all in the block; add() touches the open slot and x only
#include "accumulator.h"
#include "wide.h"

#include <string.h>

enum { ALIGN = 16, CHUNK = 256 };

static size_t aligned(size_t bytes) { return (bytes + ALIGN - 1) & ~(size_t)(ALIGN - 1); }

/// Rows the kernel may sum in double before they are folded into integers (see the public header).
static int32_t fold_rows(okid_sample_t sample) {
    switch (sample) {
    case OKID_SAMPLE_INT16: return 1 << 22;
    case OKID_SAMPLE_INT24: return 1 << 7;
    case OKID_SAMPLE_INT32: return 1 << 20;
    default: return CHUNK;
    }
}

/// Rows whose sums of codes fit 63 bits.
static int64_t row_limit(okid_sample_t sample) {
    return INT64_C(1) << (sample == OKID_SAMPLE_INT16 ? 48 : sample == OKID_SAMPLE_INT24 ? 40 : 32);
}

static int valid(const okid_accumulator_config_t* c) {
    if (c->n_u < 0 || c->n_y < 1 || c->n_u > 256 || c->n_y > 256 || c->n_u + c->n_y > 256) return 0;
    if (c->lags < 1 || c->lags > 4096) return 0;
    if ((int)c->sample < OKID_SAMPLE_DOUBLE || (int)c->sample > OKID_SAMPLE_INT32) return 0;
    if (c->block < 0 || c->slots < 0 || c->spare_slots < 0 || c->slots > 65536 || c->spare_slots > 65536) return 0;
    if (!(c->forgetting > 0 && c->forgetting <= 1)) return 0;
    if (c->slots > 0 && (c->block == 0 || c->forgetting < 1)) return 0;
    if (c->forgetting < 1 && (c->block == 0 || !c->edges)) return 0;
    if (c->bulk && (c->sample != OKID_SAMPLE_INT16 || c->block > 0)) return 0;
    return !(c->block > 0 && c->slots == 0 && !c->edges);
}

/// Offsets of everything behind the struct; returns the total number of bytes.
static size_t lay_out(okid_accumulator_t* a) {
    const okid_accumulator_config_t* c = &a->config;
    const size_t m = (size_t)a->m, p = (size_t)c->lags, pm = p * m, sums = m * m * (p + 1), number = sizeof(double);
    const int codes = c->sample != OKID_SAMPLE_DOUBLE, split = c->sample == OKID_SAMPLE_INT32;
    const int ring = c->slots > 0, base = !ring && c->edges;
    size_t at = aligned(sizeof *a);
    a->scale_at = at;
    at = aligned(at + 2 * m * number);
    a->x_at = at;
    at = aligned(at + (pm + CHUNK * m) * number);
    a->scratch_at = at;
    at = aligned(at + 2 * (pm + m) * number);
    a->partial_at = at;
    at = aligned(at + (codes ? (split ? 3 : 1) * sums * number : 0));
    a->split_at = at;
    at = aligned(at + (split ? 2 * (pm + CHUNK * m) * number : 0));
    a->spectrum_at = at;
    if (c->bulk) {
        a->plan = okid_spectrum_plan(a->m, c->lags);
        at = aligned(at + okid_spectrum_doubles(&a->plan) * number);
    }
    a->slot_mean = codes ? 2 * sums : sums;
    a->slot_head = a->slot_mean + m;
    a->slot_tail = a->slot_head + pm;
    a->slot_bytes = aligned(sizeof(slot_info_t) + (a->slot_tail + (ring || base ? pm : 0)) * number);
    a->slot_count = ring ? c->slots + c->spare_slots + 1 : 1;
    a->slots_at = at;
    at += a->slot_bytes * (size_t)a->slot_count;
    const size_t planes = codes && c->forgetting >= 1 ? 2 : 1;
    a->base_mean = planes * sums;
    a->base_edge_mean = a->base_mean + m;
    a->base_edge = a->base_edge_mean + pm;
    a->base_at = at;
    return aligned(at + (base ? (a->base_edge + planes * (pm * (pm + 1) / 2)) * number : 0));
}

static void begin(okid_accumulator_t* a, const okid_accumulator_config_t* config) {
    a->config = *config;
    a->m = config->n_u + config->n_y;
    a->width = a->m * (config->lags + 1);
    if (!okid_spectrum_pays(a->m, config->lags)) a->config.bulk = 0;
}

size_t okid_accumulator_memsize(const okid_accumulator_config_t* config) {
    if (!config || !valid(config)) return 0;
    okid_accumulator_t a;
    memset(&a, 0, sizeof a);
    begin(&a, config);
    return lay_out(&a) + ALIGN;
}

okid_status_t okid_accumulator_create(okid_accumulator_t** self, const okid_accumulator_config_t* config, void* block,
                                      size_t bytes) {
    if (!self || !config || !block) return OKID_ERR_NULL;
    if (!valid(config)) return OKID_ERR_DIM;
    if (bytes < okid_accumulator_memsize(config)) return OKID_ERR_MEMORY;
    okid_accumulator_t* a = (okid_accumulator_t*)aligned((size_t)block);
    memset(a, 0, sizeof *a);
    begin(a, config);
    const size_t size = lay_out(a);
    memset((char*)a + sizeof *a, 0, size - sizeof *a);
    for (int32_t r = 0; r < a->m; ++r) acc_scale(a)[r] = 1;
    if (a->config.bulk) okid_spectrum_create(&a->plan, acc_at(a, a->spectrum_at));
    *self = a;
    return OKID_OK;
}

void okid_accumulator_reset(okid_accumulator_t* self) {
    const size_t size = lay_out(self), from = self->x_at;
    memset((char*)self + from, 0, size - from);
    memset(&self->stats, 0, sizeof self->stats);
    if (self->config.bulk) okid_spectrum_create(&self->plan, acc_at(self, self->spectrum_at));
    self->base_weight = self->energy = 0;
    self->clock = 0;
    self->have = self->pending = self->open = self->closed = self->partial_rows = self->in_gap = 0;
}

void okid_accumulator_set_units(okid_accumulator_t* self, const double* scale, const double* offset) {
    for (int32_t r = 0; r < self->m; ++r) {
        acc_scale(self)[r] = scale[r];
        acc_scale(self)[self->m + r] = offset ? offset[r] : 0;
    }
}

/// Move the exact double sums of the kernel into the integer sums of the open slot.
static void fold_partial(okid_accumulator_t* a) {
    if (a->partial_rows == 0) return;
    double* partial = acc_at(a, a->partial_at);
    int64_t* low = (int64_t*)acc_slot_data(a, a->open);
    const size_t count = acc_sum_count(a);
    int64_t* high = low + count;
    if (a->config.sample == OKID_SAMPLE_INT32) {
        for (size_t i = 0; i < count; ++i) {
            wide_add_shifted(high + i, low + i, (int64_t)partial[i], 32);
            wide_add_shifted(high + i, low + i, (int64_t)partial[count + i], 16);
            wide_add_shifted(high + i, low + i, (int64_t)partial[2 * count + i], 0);
        }
        memset(partial, 0, 3 * count * sizeof *partial);
    } else {
        for (size_t i = 0; i < count; ++i) wide_add_shifted(high + i, low + i, (int64_t)partial[i], 0);
        memset(partial, 0, count * sizeof *partial);
    }
    a->partial_rows = 0;
}

/// 32-bit codes: kernel on the high and low halves of the codes, x = high 2^16 + low, 0 <= low < 2^16.
static void run_split(okid_accumulator_t* a, const double* x, int32_t count) {
    okid_kernel_fn* const kernel = okid_kernel_pick();
    const int32_t m = a->m, p = a->config.lags;
    const size_t numbers = (size_t)(p + count) * (size_t)m, sums = acc_sum_count(a);
    double *high = acc_at(a, a->split_at), *low = high + (size_t)(p + CHUNK) * (size_t)m;
    for (size_t i = 0; i < numbers; ++i) {
        const int32_t code = (int32_t)x[i];
        const int32_t upper = code >> 16;
        high[i] = upper;
        low[i] = code - upper * 65536;
    }
    double* partial = acc_at(a, a->partial_at);
    kernel(partial, high, high, m, p, count);
    kernel(partial + sums, high, low, m, p, count);
    kernel(partial + sums, low, high, m, p, count);
    kernel(partial + 2 * sums, low, low, m, p, count);
}

static void run_kernel(okid_accumulator_t* a, const double* x, int32_t count) {
    okid_kernel_fn* const kernel = okid_kernel_pick(); // not kept in the block: a snapshot may go to another process
    if (!acc_has_codes(a)) {
        kernel(acc_slot_data(a, a->open), x, x, a->m, a->config.lags, count);
        return;
    }
    const int32_t limit = fold_rows(a->config.sample);
    while (count > 0) {
        if (a->partial_rows == limit) fold_partial(a);
        const int32_t left = limit - a->partial_rows, piece = count < left ? count : left;
        if (a->config.sample == OKID_SAMPLE_INT32)
            run_split(a, x, piece);
        else
            kernel(acc_at(a, a->partial_at), x, x, a->m, a->config.lags, piece);
        a->partial_rows += piece;
        x += (size_t)piece * (size_t)a->m;
        count -= piece;
    }
}

/// Run the kernel over the samples that wait and keep the last p of them as the lag window.
static void flush(okid_accumulator_t* a) {
    if (a->pending == 0) return;
    const int32_t m = a->m, p = a->config.lags, count = a->pending;
    double* x = acc_x(a);
    slot_info_t* slot = acc_slot(a, a->open);
    double *data = acc_slot_data(a, a->open), *mean = data + a->slot_mean;
    if (slot->rows == 0) memcpy(data + a->slot_head, x, (size_t)(p * m) * sizeof *x);
    run_kernel(a, x, count);
    const double* newest = x + (size_t)p * (size_t)m;
    for (int32_t r = 0; r < m; ++r) {
        double sum = 0;
        for (int32_t n = 0; n < count; ++n) sum += newest[n * m + r];
        if (acc_has_codes(a))
            ((int64_t*)mean)[r] += (int64_t)sum;
        else
            mean[r] += sum;
    }
    memmove(x, x + (size_t)count * (size_t)m, (size_t)(p * m) * sizeof *x);
    slot->rows += count;
    a->pending = 0;
}

/// Round what the spectra hold back to integers and add it to the open slot.
static void flush_spectrum(okid_accumulator_t* a) {
    if (!(a->energy > 0)) return;
    fold_partial(a);
    okid_spectrum_pick().flush(&a->plan, acc_at(a, a->spectrum_at), acc_at(a, a->partial_at));
    a->partial_rows = 1; // integers far below 2^53: energy < 2^43 is what the error bound allows
    fold_partial(a);
    a->energy = 0;
}

/// Sum of squares of a channel over all windows of a batch, the largest of the channels; windows overlap by p samples.
static double batch_energy(const okid_accumulator_t* a, const int16_t* codes) {
    const int32_t m = a->m, p = a->plan.p, fresh = a->plan.fresh, total = spectrum_samples(&a->plan);
    const double* x = acc_x(a);
    int64_t most = 0;
    for (int32_t c = 0; c < m; ++c) {
        int64_t sum = 0;
        for (int32_t n = 0; n < p; ++n) sum += (int64_t)x[n * m + c] * (int64_t)x[n * m + c];
        for (int32_t n = 0; n < total; ++n) {
            const int64_t square =
                (int64_t)codes[(size_t)n * (size_t)m + (size_t)c] * codes[(size_t)n * (size_t)m + (size_t)c];
            const int again = n % fresh >= fresh - p && n < total - fresh; // the next window begins with it
            sum += again ? 2 * square : square;
        }
        if (sum > most) most = sum;
    }
    return (double)most;
}

/// Take whole batches of a long call through the FFT while the error of the sums is proven below 1/2.
/// @return samples taken, 0 when the direct kernel has to do it
static size_t feed_bulk(okid_accumulator_t* a, const int16_t* codes, size_t count) {
    const int32_t m = a->m, p = a->plan.p, total = spectrum_samples(&a->plan);
    if (count < (size_t)total) return 0;
    flush(a);
    const double energy = batch_energy(a, codes);
    if (okid_spectrum_error(&a->plan, a->energy + energy) >= 0.5) flush_spectrum(a);
    if (okid_spectrum_error(&a->plan, energy) >= 0.5) return 0;
    double* x = acc_x(a);
    slot_info_t* slot = acc_slot(a, a->open);
    double* data = acc_slot_data(a, a->open);
    if (slot->rows == 0) memcpy(data + a->slot_head, x, (size_t)(p * m) * sizeof *x);
    okid_spectrum_pick().absorb(&a->plan, acc_at(a, a->spectrum_at), x, codes);
    a->energy += energy > 0 ? energy : 1; // silence counts as rows too
    int64_t* mean = (int64_t*)(data + a->slot_mean);
    for (int32_t n = 0; n < total; ++n)
        for (int32_t r = 0; r < m; ++r) mean[r] += codes[(size_t)n * (size_t)m + (size_t)r];
    const int16_t* tail = codes + (size_t)(total - p) * (size_t)m;
    for (int32_t i = 0; i < p * m; ++i) x[i] = tail[i];
    slot->rows += total;
    a->stats.rows += total;
    a->clock += total;
    return (size_t)total;
}

void okid_accumulator_settle(okid_accumulator_t* self) {
    flush(self);
    flush_spectrum(self);
    fold_partial(self);
}

void okid_accumulator_gap(okid_accumulator_t* self, int64_t count) {
    if (self->have > 0 || self->in_gap == 0) {
        okid_accumulator_close_slot(self, 0);
        self->have = 0;
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
    okid_accumulator_clear_slot(a, a->open, 0);
}

/// One of the three kinds of samples a call brings.
typedef struct source_t {
    const double* samples;
    const int16_t* words;
    const int32_t* longs;
} source_t;

static void copy_in(source_t* source, double* to, size_t numbers) {
    if (source->samples) {
        memcpy(to, source->samples, numbers * sizeof *to);
        source->samples += numbers;
    } else if (source->words) {
        for (size_t i = 0; i < numbers; ++i) to[i] = source->words[i];
        source->words += numbers;
    } else {
        for (size_t i = 0; i < numbers; ++i) to[i] = source->longs[i];
        source->longs += numbers;
    }
}

/// Take up to `count` samples of one run; returns how many were taken.
static size_t feed(okid_accumulator_t* a, source_t* source, size_t count) {
    const int32_t m = a->m, p = a->config.lags;
    const int arming = a->have < p;
    int64_t room = p - a->have;
    if (!arming) {
        const int64_t left = a->config.block > 0 ? a->config.block - acc_slot(a, a->open)->rows : CHUNK;
        room = (left < CHUNK ? left : CHUNK) - a->pending;
    }
    if (count > (size_t)room) count = (size_t)room;
    const int32_t at = arming ? a->have : p + a->pending;
    copy_in(source, acc_x(a) + (size_t)(at * m), count * (size_t)m);
    a->clock += (int64_t)count;
    a->in_gap = 0;
    slot_info_t* slot = acc_slot(a, a->open);
    if (arming) {
        a->have += (int32_t)count;
        if (slot->rows == 0) slot->start = a->clock;
        return count;
    }
    a->pending += (int32_t)count;
    a->stats.rows += (int64_t)count;
    if (a->config.block > 0 && slot->rows + a->pending == a->config.block)
        okid_accumulator_close_slot(a, 1);
    else if (a->pending == CHUNK)
        flush(a);
    return count;
}

static void feed_run(okid_accumulator_t* a, source_t source, size_t count) {
    if (count > 0 && a->in_gap && a->config.slots == 0 && !a->config.edges) make_room(a);
    a->stats.samples += (int64_t)count;
    while (count > 0) {
        size_t taken = 0;
        if (a->config.bulk && source.words && a->have == a->config.lags) {
            taken = feed_bulk(a, source.words, count);
            source.words += taken * (size_t)a->m;
        }
        if (taken == 0) taken = feed(a, &source, count);
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
    if (acc_has_codes(self)) return OKID_ERR_MISMATCH;
    const size_t m = (size_t)self->m;
    okid_status_t status = OKID_OK;
    for (size_t i = 0; i < count;) {
        size_t run = count - i < CHUNK ? count - i : CHUNK;
        if (!finite_sample(samples + i * m, run * m)) // rare: find where it ends
            for (run = 0; finite_sample(samples + (i + run) * m, m);) ++run;
        feed_run(self, (source_t){samples + i * m, NULL, NULL}, run);
        i += run;
        if (i < count && !finite_sample(samples + i * m, m)) {
            okid_accumulator_gap(self, 1);
            status = OKID_WARN_MISSING;
            ++i;
        }
    }
    return status;
}

static okid_status_t room_for(const okid_accumulator_t* a, size_t count) {
    return a->stats.rows + (int64_t)count > row_limit(a->config.sample) ? OKID_ERR_RANGE : OKID_OK;
}

okid_status_t okid_accumulator_add_i16(okid_accumulator_t* self, const int16_t* codes, size_t count) {
    if (!self || (!codes && count > 0)) return OKID_ERR_NULL;
    if (self->config.sample != OKID_SAMPLE_INT16) return OKID_ERR_MISMATCH;
    if (room_for(self, count) != OKID_OK) return OKID_ERR_RANGE;
    const size_t numbers = count * (size_t)self->m;
    int64_t saturated = 0;
    for (size_t i = 0; i < numbers; ++i) saturated += codes[i] == INT16_MAX || codes[i] == INT16_MIN;
    self->stats.saturated += saturated;
    feed_run(self, (source_t){NULL, codes, NULL}, count);
    return saturated ? OKID_WARN_SATURATED : OKID_OK;
}

okid_status_t okid_accumulator_add_i32(okid_accumulator_t* self, const int32_t* codes, size_t count) {
    if (!self || (!codes && count > 0)) return OKID_ERR_NULL;
    if (self->config.sample != OKID_SAMPLE_INT24 && self->config.sample != OKID_SAMPLE_INT32) return OKID_ERR_MISMATCH;
    if (room_for(self, count) != OKID_OK) return OKID_ERR_RANGE;
    const int32_t top = self->config.sample == OKID_SAMPLE_INT24 ? (1 << 23) - 1 : INT32_MAX, bottom = -top - 1;
    const size_t numbers = count * (size_t)self->m;
    int64_t saturated = 0, outside = 0;
    for (size_t i = 0; i < numbers; ++i) {
        saturated += codes[i] == top || codes[i] == bottom;
        outside += codes[i] > top || codes[i] < bottom;
    }
    if (outside) return OKID_ERR_RANGE;
    self->stats.saturated += saturated;
    feed_run(self, (source_t){NULL, NULL, codes}, count);
    return saturated ? OKID_WARN_SATURATED : OKID_OK;
}

void okid_accumulator_stats(const okid_accumulator_t* self, okid_accumulator_stats_t* out) { *out = self->stats; }
void okid_accumulator_config(const okid_accumulator_t* self, okid_accumulator_config_t* out) { *out = self->config; }
int64_t okid_accumulator_rows(const okid_accumulator_t* self) { return self->stats.rows; }
