// SPDX-License-Identifier: MIT
// PURPOSE    recursive, mergeable shift-structured Gram sums in the caller's memory: layout, creation, counts
// METHOD     see absorb.c (samples), slots.c (ends of runs), gram.c (what it is for), centre.c, serial.c
// REFERENCE  paper eq. (36)-(38) without the zero columns; shift structure: docs/numerics.md
// NUMERICS   offsets, no pointers: a memcpy of the block is a snapshot
// WORKSPACE  none; the block holds state, the samples that wait and, for codes, what the kernel writes to
#include "accumulator.h"

enum { ALIGN = 16 };

static int valid(const okid_accumulator_config_t* c) {
    if (c->n_u < 0 || c->n_y < 1 || c->n_u > 256 || c->n_y > 256 || c->n_u + c->n_y > 256) return 0;
    if (c->lags < 1 || c->lags > 4096) return 0;
    if ((unsigned)c->sample > OKID_SAMPLE_INT32) return 0;
    if (c->block < 0 || c->slots < 0 || c->spare_slots < 0 || c->slots > 65536 || c->spare_slots > 65536) return 0;
    if (!(c->forgetting > 0 && c->forgetting <= 1)) return 0;
    if (c->slots > 0 && (c->block == 0 || c->forgetting < 1)) return 0;
    if (c->forgetting < 1 && (c->block == 0 || !c->edges)) return 0;
    if (c->bulk && ((c->sample != OKID_SAMPLE_INT16 && c->sample != OKID_SAMPLE_DOUBLE) || c->block > 0)) return 0;
    if (c->buffer < 0 || c->buffer > 65536) return 0;
    return !(c->block > 0 && c->slots == 0 && !c->edges);
}

/// Hand out `numbers` numbers behind the `*at` numbers already given.
static uint32_t take(uint64_t* at, uint64_t numbers) {
    const uint64_t here = *at;
    *at += (numbers + 1) & ~(uint64_t)1; // each part begins on 16 bytes
    return (uint32_t)here;
}

/// Planes of sums the kernel writes to before they are folded into the pairs.
static uint64_t partial_planes(okid_sample_t sample) {
#ifdef OKID_INTEGER_KERNEL
    (void)sample;
    return 0; // it adds to the low words themselves
#else
    return sample == OKID_SAMPLE_DOUBLE ? 0 : sample == OKID_SAMPLE_INT32 ? 3 : 1;
#endif
}

/// Place everything behind the struct; returns the total in numbers, 0 when places leave 32 bits.
static uint64_t lay_out(okid_accumulator_t* a) {
    const okid_accumulator_config_t* c = &a->config;
    const uint64_t m = (uint64_t)a->m, pm = acc_lag_count(a), sums = acc_sum_count(a), rows = (uint64_t)c->buffer;
    const int ring = c->slots > 0, base = !ring && c->edges, split = partial_planes(c->sample) == 3;
    uint64_t at = 0;
    take(&at, (sizeof *a + 7) / 8);
    a->scale_at = take(&at, 2 * m);
    a->x_at = take(&at, pm + rows * m);
    a->partial_at = take(&at, partial_planes(c->sample) * sums);
    a->split_at = take(&at, split ? 2 * (pm + rows * m) : 0);
    a->bulk_at = take(&at, 0);
    if (acc_bulk_on(c)) {
        const spectrum_plan_t plan = okid_spectrum_plan(a->m, c->lags);
        take(&at, sizeof(bulk_t) / 8 + okid_spectrum_doubles(&plan));
    }
    a->slot_numbers = (uint32_t)(sizeof(slot_info_t) / 8 + acc_slot_tail(a) + (ring ? pm : 0));
    a->slot_count = ring ? c->slots + c->spare_slots + 1 : 1;
    a->slots_at = take(&at, (uint64_t)a->slot_numbers * (uint64_t)a->slot_count);
    const uint64_t edges = acc_base_edge(a) + acc_edge_count(a) * (acc_base_is_exact(a) ? 2 : 1);
    const int fits = at <= UINT32_MAX;
    a->base_at = take(&at, base ? edges : 0);
    return fits ? at : 0;
}

static void begin(okid_accumulator_t* a, const okid_accumulator_config_t* config) {
    memset(a, 0, sizeof *a);
    a->config = *config;
    if (a->config.buffer == 0) a->config.buffer = ACC_BUFFER;
    a->m = config->n_u + config->n_y;
    a->width = a->m * (config->lags + 1);
    if (!acc_bulk_on(config) || !okid_spectrum_pays(a->m, config->lags)) a->config.bulk = 0;
}

size_t okid_accumulator_memsize(const okid_accumulator_config_t* config) {
    if (!config || !valid(config)) return 0;
    okid_accumulator_t a;
    begin(&a, config);
    const uint64_t numbers = lay_out(&a);
    return numbers == 0 || numbers > SIZE_MAX / 8 - ALIGN ? 0 : (size_t)numbers * 8 + ALIGN;
}

static void prepare_bulk(okid_accumulator_t* a) {
    if (!acc_bulk_on(&a->config)) return;
    acc_bulk(a)->plan = okid_spectrum_plan(a->m, a->config.lags);
    okid_spectrum_create(&acc_bulk(a)->plan, acc_spectra(a));
}

okid_status_t okid_accumulator_create(okid_accumulator_t** self, const okid_accumulator_config_t* config, void* block,
                                      size_t bytes) {
    if (!self || !config || !block) return OKID_ERR_NULL;
    const size_t needed = okid_accumulator_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid_accumulator_t* a = (okid_accumulator_t*)(((size_t)block + ALIGN - 1) & ~(size_t)(ALIGN - 1));
    begin(a, config);
    const size_t size = (size_t)lay_out(a) * 8;
    memset((char*)a + sizeof *a, 0, size - sizeof *a);
    for (int32_t r = 0; r < a->m; ++r) acc_scale(a)[r] = 1;
    prepare_bulk(a);
    *self = a;
    return OKID_OK;
}

okid_status_t okid_accumulator_copy(okid_accumulator_t* self, const okid_accumulator_t* from) {
    if (!self || !from) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &from->config;
    if (a->n_u != b->n_u || a->n_y != b->n_y || a->lags != b->lags || a->sample != b->sample || a->block != b->block ||
        a->slots != b->slots || a->forgetting != b->forgetting || a->edges != b->edges ||
        a->spare_slots != b->spare_slots || a->bulk != b->bulk || a->saturated_missing != b->saturated_missing ||
        a->buffer != b->buffer)
        return OKID_ERR_MISMATCH;
    if (self != from) memcpy(self, from, (size_t)lay_out(self) * 8);
    return OKID_OK;
}

void okid_accumulator_reset(okid_accumulator_t* self) {
    if (!self) return;
    const size_t size = (size_t)lay_out(self) * 8, from = 8 * (size_t)self->x_at;
    memset((char*)self + from, 0, size - from);
    memset(&self->stats, 0, sizeof self->stats);
    prepare_bulk(self);
    self->base_weight = 0;
    self->clock = self->partial_rows = 0;
    self->have = self->pending = self->open = self->closed = self->in_gap = self->centred = 0;
}

void okid_accumulator_set_units(okid_accumulator_t* self, const double* scale, const double* offset) {
    if (!self || !scale) return;
    for (int32_t r = 0; r < self->m; ++r) {
        acc_scale(self)[r] = scale[r];
        acc_scale(self)[self->m + r] = offset ? offset[r] : 0;
    }
}

void okid_accumulator_stats(const okid_accumulator_t* self, okid_accumulator_stats_t* out) {
    static const okid_accumulator_stats_t none = {0};
    if (out) *out = self ? self->stats : none;
}

void okid_accumulator_config(const okid_accumulator_t* self, okid_accumulator_config_t* out) {
    static const okid_accumulator_config_t none = {0};
    if (out) *out = self ? self->config : none;
}

int64_t okid_accumulator_rows(const okid_accumulator_t* self) { return self ? self->stats.rows : 0; }

double okid_accumulator_weight(const okid_accumulator_t* a) {
    double rows = a->base_weight;
    for (int32_t k = 0; k <= a->closed; ++k) rows += (double)acc_slot(a, acc_ring(a, k))->rows;
    return rows;
}
