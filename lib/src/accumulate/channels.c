// SPDX-License-Identifier: MIT
// PURPOSE    an accumulator without some of its channels: what it would hold had they never been measured
// METHOD     every part of it is a table of samples, of products of samples or of sums, by channel: the channels kept are copied
// NUMERICS   nothing is computed: the numbers are the same bits
// WORKSPACE  none
#include "accumulator.h"

/// Which channels of `from` make those of `to`.
typedef struct choice_t {
    const okid_accumulator_t *to, *from;
    const int32_t* channels;
} choice_t;

/// Rows of channels, one after the other: samples in the order of time, or of their lags.
static void take_rows(const choice_t* of, double* to, const double* from, size_t rows) {
    const size_t m = (size_t)of->to->m, its = (size_t)of->from->m;
    for (size_t r = 0; r < rows; ++r)
        for (size_t c = 0; c < m; ++c) to[r * m + c] = from[r * its + (size_t)of->channels[c]];
}

/// S in one plane of words or two, and the sums of the channels behind it.
static void take_sums(const choice_t* of, double* to, const double* from, int planes) {
    const okid_accumulator_t *a = of->to, *b = of->from;
    const size_t lags = (size_t)a->config.lags + 1;
    for (int plane = 0; plane < planes; ++plane) {
        for (size_t r = 0; r < (size_t)a->m; ++r)
            take_rows(of, to + r * (size_t)a->width, from + (size_t)of->channels[r] * (size_t)b->width, lags);
        to += acc_sum_count(a);
        from += acc_sum_count(b);
    }
    take_rows(of, to, from, 1);
}

/// Packed upper triangle of products by lag and channel.
static void take_edges(const choice_t* of, double* to, const double* from) {
    const size_t m = (size_t)of->to->m, its = (size_t)of->from->m, ends = acc_lag_count(of->to);
    for (size_t j = 0; j < ends; ++j) {
        const size_t column = j / m * its + (size_t)of->channels[j % m];
        for (size_t i = 0; i <= j; ++i)
            *to++ = from[column * (column + 1) / 2 + i / m * its + (size_t)of->channels[i % m]];
    }
}

static void take_base(const choice_t* of) {
    const okid_accumulator_t *a = of->to, *b = of->from;
    const int planes = acc_base_is_exact(a) ? 2 : 1;
    take_sums(of, acc_base(a), acc_base(b), planes);
    take_rows(of, acc_base(a) + acc_base_edge_sum(a), acc_base(b) + acc_base_edge_sum(b), (size_t)a->config.lags);
    for (int plane = 0; plane < planes; ++plane)
        take_edges(of, acc_base(a) + acc_base_edge(a) + (size_t)plane * acc_edge_count(a),
                   acc_base(b) + acc_base_edge(b) + (size_t)plane * acc_edge_count(b));
}

static void take_slot(const choice_t* of, int32_t index) {
    const okid_accumulator_t *a = of->to, *b = of->from;
    double* to = acc_slot_data(a, index);
    const double* from = acc_slot_data(b, index);
    *acc_slot(a, index) = *acc_slot(b, index);
    take_sums(of, to, from, acc_has_codes(a) ? 2 : 1);
    take_rows(of, to + acc_slot_head(a), from + acc_slot_head(b), (size_t)a->config.lags);
    if (a->config.slots > 0) take_rows(of, to + acc_slot_tail(a), from + acc_slot_tail(b), (size_t)a->config.lags);
}

/// Inputs first, each channel once, in their order.
static int are_channels(const okid_accumulator_t* self, const okid_accumulator_t* from, const int32_t* channels) {
    for (int32_t c = 0; c < self->m; ++c) {
        if (channels[c] < 0 || channels[c] >= from->m || (c > 0 && channels[c] <= channels[c - 1])) return 0;
        if ((c < self->config.n_u) != (channels[c] < from->config.n_u)) return 0;
    }
    return 1;
}

okid_status_t okid_accumulator_take_channels(okid_accumulator_t* self, okid_accumulator_t* from,
                                             const int32_t* channels) {
    if (!self || !from || !channels) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &from->config;
    if (self == from || a->lags != b->lags || a->sample != b->sample || a->slots != b->slots || a->edges != b->edges ||
        a->spare_slots != b->spare_slots || (a->forgetting < 1) != (b->forgetting < 1))
        return OKID_ERR_MISMATCH;
    if (!are_channels(self, from, channels)) return OKID_ERR_DIM;
    okid_accumulator_settle(from);
    okid_accumulator_reset(self);
    const choice_t of = {self, from, channels};
    self->config.block = b->block;
    self->config.forgetting = b->forgetting;
    self->stats = from->stats;
    self->clock = from->clock;
    self->base_weight = from->base_weight;
    self->open = from->open;
    self->closed = from->closed;
    self->have = from->have;
    self->in_gap = from->in_gap;
    self->centred = from->centred;
    take_rows(&of, acc_scale(self), acc_scale(from), 2);
    take_rows(&of, acc_x(self), acc_x(from), (size_t)a->lags);
    for (int32_t k = 0; k <= self->closed; ++k) take_slot(&of, acc_ring(self, k));
    if (a->edges && a->slots == 0) take_base(&of);
    return OKID_OK;
}
