// SPDX-License-Identifier: MIT
// PURPOSE    correlation sums as bytes that another machine, another build or a later version can read
// METHOD     one walk over the state counts, writes or reads (walk.h)
// REFERENCE  the layout stands in correlation.h at okid_correlation_serialised_size()
// NUMERICS   bit for bit
// WORKSPACE  none; O(bytes)
#include "correlation.h"
#include "walk.h"

enum { FORMAT = 1, HEADER_WORDS = 9, HEADER = 8 + 4 * HEADER_WORDS + 8 };
static const char MAGIC[8] = {'O', 'K', 'I', 'D', 'C', 'O', 'R', '\n'};

/// Magic, version and what two objects must have in common.
static void walk_header(walk_t* w, okid_correlation_config_t* c, int32_t* version, char* magic) {
    for (int i = 0; i < 8; ++i) magic[i] = (char)walk_bits(w, (uint8_t)magic[i], 1);
    int32_t sample = (int32_t)c->sample;
    int32_t* const words[HEADER_WORDS] = {
        version, &c->n_u, &c->n_y, &c->lags, &c->own_lags, &sample, &c->block, &c->slots, &c->saturated_missing};
    for (int i = 0; i < HEADER_WORDS; ++i) walk_i32(w, words[i]);
    walk_numbers(w, &c->forgetting, 1);
    c->sample = (okid_sample_t)sample;
}

/// Everything behind the header; the slots in the order of time, so that they lie from 0 on in the one that reads.
static void walk_state(walk_t* w, okid_correlation_t* s) {
    walk_numbers(w, &s->stats, sizeof s->stats / 8);
    walk_i64(w, &s->clock);
    walk_i32(w, &s->have);
    walk_i32(w, &s->in_gap);
    walk_i32(w, &s->closed);
    walk_numbers(w, cor_scale(s), (size_t)s->m);
    walk_numbers(w, cor_at(s, s->u_at), cor_u_window(s));
    walk_numbers(w, cor_at(s, s->y_at), cor_y_window(s));
    const int32_t slots = s->closed < s->ring ? s->closed + 1 : s->ring;
    for (int32_t k = 0; k < slots; ++k) walk_numbers(w, cor_slot(s, k), s->slot_numbers);
    const int32_t sets = s->config.block > 0 ? slots : 1;
    for (int32_t k = 0; k < sets; ++k) walk_numbers(w, cor_sums(s, k), s->sums_numbers);
}

static size_t walk_all(okid_correlation_t* s, uint8_t* to) {
    okid_correlation_config_t config = s->config;
    int32_t version = FORMAT;
    char magic[8];
    memcpy(magic, MAGIC, 8);
    walk_t w = {to, NULL, 0};
    walk_header(&w, &config, &version, magic);
    walk_state(&w, s);
    return w.at;
}

size_t okid_correlation_serialised_size(okid_correlation_t* self) {
    if (!self) return 0;
    okid_correlation_settle(self);
    return walk_all(self, NULL) + 4;
}

okid_status_t okid_correlation_serialise(okid_correlation_t* self, void* out, size_t bytes) {
    if (!self || !out) return OKID_ERR_NULL;
    if (bytes < okid_correlation_serialised_size(self)) return OKID_ERR_MEMORY;
    walk_t end = {(uint8_t*)out, NULL, walk_all(self, (uint8_t*)out)};
    walk_bits(&end, crc32_of((const uint8_t*)out, end.at), 4);
    return OKID_OK;
}

okid_status_t okid_correlation_peek(const void* in, size_t bytes, okid_correlation_config_t* out) {
    if (!in || !out) return OKID_ERR_NULL;
    if (bytes < HEADER + 4) return OKID_ERR_FORMAT;
    walk_t end = {NULL, (const uint8_t*)in, bytes - 4};
    if ((uint32_t)walk_bits(&end, 0, 4) != crc32_of((const uint8_t*)in, bytes - 4)) return OKID_ERR_FORMAT;
    okid_correlation_config_t config = {0};
    char magic[8] = {0};
    int32_t version = 0;
    walk_t w = {NULL, (const uint8_t*)in, 0};
    walk_header(&w, &config, &version, magic);
    if (memcmp(magic, MAGIC, 8) != 0 || version != FORMAT || okid_correlation_memsize(&config) == 0)
        return OKID_ERR_FORMAT;
    *out = config;
    return OKID_OK;
}

static int sane_samples(walk_t* w, const okid_correlation_t* s, size_t count) {
    if (cor_codes(s)) return sane_whole(w, count, UINT64_C(1) << 31);
    int sane = 1;
    for (size_t i = 0; i < count; ++i) sane &= sane_number(w, 1);
    return sane;
}

/// What walk_state() is about to read. Nothing is changed.
static int sane_state(const okid_correlation_t* s, const void* in, int32_t closed) {
    walk_t w = {NULL, (const uint8_t*)in, HEADER}, counts = w;
    counts.at += offsetof(okid_accumulator_stats_t, rows);
    uint64_t left = walk_bits(&counts, 0, 8); // rows that are in no slot yet looked at
    int sane = 1;
    for (size_t i = 0; i < sizeof s->stats / 8 + 1; ++i) sane &= sane_count(&w); // and the clock
    w.at += 4;                                                                   // samples at hand
    sane &= walk_bits(&w, 0, 4) <= 1;                                            // in a gap
    w.at += 4;                                                                   // closed slots
    for (int32_t i = 0; i < s->m; ++i) sane &= sane_number(&w, 1);
    sane &= sane_samples(&w, s, cor_u_window(s) + cor_y_window(s));
    const int32_t slots = closed < s->ring ? closed + 1 : s->ring, block = s->config.block;
    for (int32_t k = 0; k < slots; ++k) {
        const uint64_t rows = walk_bits(&w, 0, 8);
        sane &= rows <= left && (block == 0 || rows < (uint64_t)block + (k < closed));
        left -= rows <= left ? rows : left;
        sane &= sane_samples(&w, s, s->slot_numbers - sizeof(cor_slot_t) / 8);
    }
    for (int32_t k = 0; k < (block > 0 ? slots : 1); ++k) {
        const size_t products = cor_sum_count(s);
        if (cor_codes(s))
            sane &= sane_wide(&w, products) & sane_whole(&w, s->sums_numbers - 2 * products, UINT64_C(1) << 62);
        else
            sane &= sane_samples(&w, s, s->sums_numbers);
    }
    return sane;
}

okid_status_t okid_correlation_deserialise(okid_correlation_t* self, const void* in, size_t bytes) {
    if (!self) return OKID_ERR_NULL;
    okid_correlation_config_t c;
    const okid_status_t status = okid_correlation_peek(in, bytes, &c);
    if (status != OKID_OK) return status;
    const okid_correlation_config_t* own = &self->config;
    if (c.n_u != own->n_u || c.n_y != own->n_y || c.lags != own->lags || c.own_lags != own->own_lags ||
        c.sample != own->sample || c.block != own->block || c.slots != own->slots || c.forgetting < own->forgetting ||
        c.forgetting > own->forgetting)
        return OKID_ERR_MISMATCH;
    // The length must be that of the state before anything is touched: beside the configuration it depends on `closed` only.
    walk_t look = {NULL, (const uint8_t*)in, HEADER + sizeof self->stats + 8};
    if (bytes < look.at + 12) return OKID_ERR_FORMAT;
    int32_t words[3] = {0, 0, 0};
    for (int i = 0; i < 3; ++i) walk_i32(&look, words + i);
    const int32_t have = words[0], closed = words[2], most = self->ring - (own->block > 0);
    if (have < 0 || have > own->lags || closed < 0 || closed > most) return OKID_ERR_FORMAT;
    const int32_t kept = self->closed;
    self->closed = closed;
    walk_t count = {NULL, NULL, HEADER};
    walk_state(&count, self);
    self->closed = kept;
    if (count.at + 4 != bytes || !sane_state(self, in, closed)) return OKID_ERR_FORMAT;
    okid_correlation_reset(self);
    walk_t w = {NULL, (const uint8_t*)in, HEADER};
    walk_state(&w, self);
    return OKID_OK;
}
