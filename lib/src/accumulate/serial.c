// SPDX-License-Identifier: MIT
// PURPOSE    an accumulator as bytes that another machine, another build or a later version can read
// METHOD     one walk over the state counts, writes or reads; little endian, codes as integers, CRC-32 (IEEE 802.3) at the end
// REFERENCE  the layout stands in accumulator.h at okid_accumulator_serialise()
// NUMERICS   bit for bit
// WORKSPACE  none; O(bytes)
#include "accumulator.h"
#include "walk.h"

enum { FORMAT = 1, HEADER_WORDS = 10 };
static const char MAGIC[8] = {'O', 'K', 'I', 'D', 'A', 'C', 'C', '\n'};

/// Samples: doubles, codes as 32-bit integers.
static void walk_samples(walk_t* w, const okid_accumulator_t* a, double* samples, size_t count) {
    if (!acc_has_codes(a)) {
        walk_numbers(w, samples, count);
        return;
    }
    for (size_t i = 0; i < count; ++i) {
        int32_t code = (int32_t)acc_code(samples + i);
        walk_i32(w, &code);
        acc_put_code(samples + i, code);
    }
}

/// Magic, version and what two accumulators must have in common.
static void walk_header(walk_t* w, okid_accumulator_config_t* c, int32_t* version, char* magic) {
    for (int i = 0; i < 8; ++i) magic[i] = (char)walk_bits(w, (uint8_t)magic[i], 1);
    int32_t sample = (int32_t)c->sample;
    int32_t* const words[HEADER_WORDS] = {version,   &c->n_u,   &c->n_y,   &c->lags,        &sample,
                                          &c->block, &c->slots, &c->edges, &c->spare_slots, &c->saturated_missing};
    for (int i = 0; i < HEADER_WORDS; ++i) walk_i32(w, words[i]);
    walk_numbers(w, &c->forgetting, 1);
    c->sample = (okid_sample_t)sample;
}

static void walk_slot(walk_t* w, okid_accumulator_t* a, int32_t index) {
    slot_info_t* slot = acc_slot(a, index);
    double* data = acc_slot_data(a, index);
    walk_numbers(w, slot, sizeof *slot / 8);
    walk_numbers(w, data, acc_slot_head(a));
    walk_samples(w, a, data + acc_slot_head(a), acc_lag_count(a));
    if (a->config.slots > 0) walk_samples(w, a, data + acc_slot_tail(a), acc_lag_count(a));
}

/// Everything behind the header. The slots in the order of time, so that they lie from 0 on in the one that reads.
static void walk_state(walk_t* w, okid_accumulator_t* a) {
    walk_numbers(w, &a->stats, sizeof a->stats / 8);
    walk_i64(w, &a->clock);
    walk_numbers(w, &a->base_weight, 1);
    int32_t* const words[] = {&a->have, &a->in_gap, &a->centred, &a->closed};
    for (int i = 0; i < 4; ++i) walk_i32(w, words[i]);
    if (w->from) a->open = a->closed;
    walk_numbers(w, acc_scale(a), 2 * (size_t)a->m);
    walk_samples(w, a, acc_x(a), (size_t)a->have * (size_t)a->m);
    for (int32_t k = 0; k <= a->closed; ++k) walk_slot(w, a, acc_ring(a, k));
    if (a->config.slots > 0 || !a->config.edges) return;
    walk_numbers(w, acc_base(a), acc_base_edge(a) + acc_edge_count(a) * (acc_base_is_exact(a) ? 2 : 1));
}

static size_t walk_all(okid_accumulator_t* a, uint8_t* to) {
    okid_accumulator_config_t config = a->config;
    int32_t version = FORMAT;
    char magic[8];
    memcpy(magic, MAGIC, 8);
    walk_t w = {to, NULL, 0};
    walk_header(&w, &config, &version, magic);
    walk_state(&w, a);
    return w.at;
}

size_t okid_accumulator_serialised_size(okid_accumulator_t* self) {
    if (!self) return 0;
    okid_accumulator_settle(self);
    return walk_all(self, NULL) + 4;
}

okid_status_t okid_accumulator_serialise(okid_accumulator_t* self, void* out, size_t bytes) {
    if (!self || !out) return OKID_ERR_NULL;
    if (bytes < okid_accumulator_serialised_size(self)) return OKID_ERR_MEMORY;
    walk_t end = {(uint8_t*)out, NULL, walk_all(self, (uint8_t*)out)};
    walk_bits(&end, crc32_of((const uint8_t*)out, end.at), 4);
    return OKID_OK;
}

okid_status_t okid_accumulator_peek(const void* in, size_t bytes, okid_accumulator_config_t* out) {
    if (!in || !out) return OKID_ERR_NULL;
    if (bytes < 8 + 4 * HEADER_WORDS + 8 + 4) return OKID_ERR_FORMAT;
    walk_t end = {NULL, (const uint8_t*)in, bytes - 4};
    if ((uint32_t)walk_bits(&end, 0, 4) != crc32_of((const uint8_t*)in, bytes - 4)) return OKID_ERR_FORMAT;
    okid_accumulator_config_t config = {0};
    char magic[8] = {0};
    int32_t version = 0;
    walk_t w = {NULL, (const uint8_t*)in, 0};
    walk_header(&w, &config, &version, magic);
    if (memcmp(magic, MAGIC, 8) != 0 || version != FORMAT || okid_accumulator_memsize(&config) == 0)
        return OKID_ERR_FORMAT;
    *out = config;
    return OKID_OK;
}

/// What so many codes of 32 bits can sum to, as far as that can be multiplied by their mean.
static uint64_t most_sum(uint64_t rows) { return rows < 1u << 27 ? rows << 31 : UINT64_C(1) << 58; }

/// Lagged products and sums: finite, and some square above 0 where one is below (rounding leaves the like of a constant).
static int sane_sums(walk_t* w, const okid_accumulator_t* a, int exact, uint64_t rows) {
    const size_t products = acc_sum_count(a), width = (size_t)a->width, newest = acc_lag_count(a);
    if (exact) return sane_wide(w, products) & sane_whole(w, (size_t)a->m, most_sum(rows));
    int sane = 1, above = 0, below = 0;
    for (size_t i = 0; i < products; ++i) {
        const walk_t here = *w;
        sane &= sane_number(w, 1);
        if (i % width != newest + i / width) continue;
        walk_t again = here, bits = here;
        if (sane_number(&again, 0))
            above |= walk_bits(&bits, 0, 8) != 0;
        else
            below = 1;
    }
    for (int32_t i = 0; i < a->m; ++i) sane &= sane_number(w, 1);
    return sane && (above || !below);
}

static int sane_samples(walk_t* w, const okid_accumulator_t* a, size_t count) {
    int sane = 1;
    for (size_t i = 0; i < count; ++i)
        if (acc_has_codes(a))
            w->at += 4;
        else
            sane &= sane_number(w, 1);
    return sane;
}

/// What walk_state() is about to read: a checksum that is right says nothing of the numbers. Nothing is changed.
static int sane_state(const okid_accumulator_t* a, const void* in, size_t header, int32_t have, int32_t closed) {
    walk_t w = {NULL, (const uint8_t*)in, header}, counts = w;
    counts.at += offsetof(okid_accumulator_stats_t, rows);
    uint64_t left = (uint64_t)walk_bits(&counts, 0, 8);       // rows that are in no slot yet looked at
    const int base = a->config.edges && a->config.slots == 0; // else there is no room for one
    int sane = 1;
    for (size_t i = 0; i < sizeof a->stats / 8 + 1; ++i) sane &= sane_count(&w); // and the clock
    counts.at = w.at;
    sane &= sane_number(&w, 0) & (base || walk_bits(&counts, 0, 8) == 0); // weight of the base
    for (int i = 0; i < 4; ++i) {
        const uint32_t word = (uint32_t)walk_bits(&w, 0, 4);
        if (i == 1 || i == 2) sane &= word <= (i == 1 || base); // in a gap, centred
    }
    for (int32_t i = 0; i < 2 * a->m; ++i) sane &= sane_number(&w, 1);
    sane &= sane_samples(&w, a, (size_t)have * (size_t)a->m);
    for (int32_t k = 0; k <= closed; ++k) {
        counts.at = w.at;
        const uint64_t rows = (uint64_t)walk_bits(&counts, 0, 8);
        for (int i = 0; i < 3; ++i) sane &= sane_count(&w); // rows, start, joined
        sane &= sane_sums(&w, a, acc_has_codes(a), rows) & (rows <= left);
        if (a->config.block > 0) sane &= rows < (uint64_t)a->config.block + (k < closed);
        left -= rows <= left ? rows : left;
        sane &= sane_samples(&w, a, acc_lag_count(a) * (a->config.slots > 0 ? 2 : 1));
    }
    if (!base) return sane;
    sane &= sane_sums(&w, a, acc_base_is_exact(a), left);
    if (acc_base_is_exact(a))
        sane &= sane_whole(&w, acc_lag_count(a), UINT64_C(1) << 50) & sane_wide(&w, acc_edge_count(a));
    else
        for (size_t i = 0; i < acc_lag_count(a) + acc_edge_count(a); ++i) sane &= sane_number(&w, 1);
    return sane;
}

okid_status_t okid_accumulator_deserialise(okid_accumulator_t* self, const void* in, size_t bytes) {
    if (!self) return OKID_ERR_NULL;
    okid_accumulator_config_t c;
    const okid_status_t status = okid_accumulator_peek(in, bytes, &c);
    if (status != OKID_OK) return status;
    const okid_accumulator_config_t* own = &self->config;
    if (c.n_u != own->n_u || c.n_y != own->n_y || c.lags != own->lags || c.sample != own->sample ||
        c.block != own->block || c.slots != own->slots || c.edges != own->edges || c.spare_slots != own->spare_slots ||
        c.forgetting < own->forgetting || c.forgetting > own->forgetting)
        return OKID_ERR_MISMATCH;
    // The length must be that of the state before anything is touched: it depends on what is at hand only.
    const size_t header = 8 + 4 * HEADER_WORDS + 8;
    walk_t look = {NULL, (const uint8_t*)in, header + sizeof self->stats + 16};
    if (bytes < look.at + 16) return OKID_ERR_FORMAT;
    const int32_t kept[3] = {self->have, self->open, self->closed};
    int32_t have = 0, closed = 0, other = 0;
    walk_i32(&look, &have);
    walk_i32(&look, &other);
    walk_i32(&look, &other);
    walk_i32(&look, &closed);
    if (have < 0 || have > own->lags || closed < 0 || closed >= self->slot_count) return OKID_ERR_FORMAT;
    self->have = have;
    self->open = self->closed = closed;
    walk_t count = {NULL, NULL, header};
    walk_state(&count, self);
    self->have = kept[0];
    self->open = kept[1];
    self->closed = kept[2];
    if (count.at + 4 != bytes || !sane_state(self, in, header, have, closed)) return OKID_ERR_FORMAT;
    okid_accumulator_reset(self);
    walk_t w = {NULL, (const uint8_t*)in, header};
    walk_state(&w, self);
    return OKID_OK;
}
