// SPDX-License-Identifier: MIT
// PURPOSE    what happens when an unbroken piece of the record ends: into the ring, or into the base; merging of records
// METHOD     window: whole slots fall out of a ring, nothing is ever subtracted. Growing: base += slot, and the ends of the
//            run go into the edge Gram as outer products. Forgetting: base *= lambda^rows before
// REFERENCE  docs/decisions/0001-gap-closes-a-slot.md
// NUMERICS   codes: exact (wide.h); doubles: one addition a slot
// WORKSPACE  none; (p m)^2 flop a run
#include "accumulator.h"
#include "wide.h"

#include <math.h>

void okid_accumulator_clear_slot(okid_accumulator_t* self, int32_t index, int joined) {
    slot_info_t* slot = acc_slot(self, index);
    memset(slot, 0, (size_t)self->slot_numbers * sizeof(double));
    slot->joined = joined;
    slot->start = self->clock - self->pending;
}

/// Exact base += open slot: sums, then the ends of its run.
static void fold_exact(okid_accumulator_t* a, const double* head, const double* tail) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, sums = acc_sum_count(a), packed = acc_edge_count(a);
    const int64_t* data = (const int64_t*)acc_slot_data(a, a->open);
    int64_t* base = (int64_t*)acc_base(a);
    for (size_t i = 0; i < sums; ++i) wide_add_wide(base + sums + i, base + i, data[sums + i], data[i]);
    for (size_t r = 0; r < m; ++r) base[acc_base_sum(a) + r] += data[acc_slot_sum(a) + r];
    int64_t *low = base + acc_base_edge(a), *high = low + packed, *edge_sum = base + acc_base_edge_sum(a);
    for (size_t lj = 0; lj < p; ++lj)
        for (size_t cj = 0; cj < m; ++cj) {
            const size_t j = lj * m + cj, column = j * (j + 1) / 2;
            const int64_t hj = acc_code(head + acc_end(a, lj, cj)), tj = acc_code(tail + acc_end(a, lj, cj));
            edge_sum[j] += hj - tj;
            for (size_t li = 0, i = 0; li <= lj; ++li) {
                const double *h = head + acc_end(a, li, 0), *t = tail + acc_end(a, li, 0);
                for (size_t ci = 0; ci < m && i <= j; ++ci, ++i) {
                    wide_add(high + column + i, low + column + i, acc_code(h + ci) * hj);
                    wide_add(high + column + i, low + column + i, -(acc_code(t + ci) * tj));
                }
            }
        }
}

/// base = weight * base + open slot in double.
static void fold_double(okid_accumulator_t* a, double weight, const double* head, const double* tail) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, sums = acc_sum_count(a);
    const double* data = acc_slot_data(a, a->open);
    const int64_t* codes = (const int64_t*)data;
    const int exact = acc_has_codes(a);
    double *base = acc_base(a), *sum = base + acc_base_sum(a), *edge = base + acc_base_edge(a);
    for (size_t i = 0; i < sums; ++i)
        base[i] = weight * base[i] + (exact ? wide_double(codes[sums + i], codes[i]) : data[i]);
    for (size_t r = 0; r < m; ++r) {
        const size_t at = acc_slot_sum(a) + r;
        sum[r] = weight * sum[r] + (exact ? (double)codes[at] : data[at]);
    }
    double* edge_sum = base + acc_base_edge_sum(a);
    for (size_t lj = 0; lj < p; ++lj)
        for (size_t cj = 0; cj < m; ++cj) {
            const size_t j = lj * m + cj;
            const double hj = acc_number(a, head + acc_end(a, lj, cj)), tj = acc_number(a, tail + acc_end(a, lj, cj));
            edge_sum[j] = weight * edge_sum[j] + hj - tj;
            double* column = edge + j * (j + 1) / 2;
            for (size_t li = 0, i = 0; li <= lj; ++li) {
                const double *h = head + acc_end(a, li, 0), *t = tail + acc_end(a, li, 0);
                for (size_t ci = 0; ci < m && i <= j; ++ci, ++i)
                    column[i] = weight * column[i] + acc_number(a, h + ci) * hj - acc_number(a, t + ci) * tj;
            }
        }
}

/// The open slot goes into the base. Its tail must stand.
static void fold_slot_into_base(okid_accumulator_t* a, double weight) {
    const double *head = acc_slot_data(a, a->open) + acc_slot_head(a),
                 *tail = acc_slot_data(a, a->open) + acc_slot_tail(a);
    if (acc_base_is_exact(a))
        fold_exact(a, head, tail);
    else
        fold_double(a, weight, head, tail);
    a->base_weight = a->base_weight * weight + (double)acc_slot(a, a->open)->rows;
}

static void drop_oldest(okid_accumulator_t* a) {
    a->stats.rows -= acc_slot(a, acc_oldest(a))->rows;
    a->closed -= 1;
}

void okid_accumulator_close_slot(okid_accumulator_t* self, int joined) {
    okid_accumulator_settle(self);
    const okid_accumulator_config_t* c = &self->config;
    const slot_info_t* slot = acc_slot(self, self->open);
    if (slot->rows == 0) {
        okid_accumulator_clear_slot(self, self->open, joined);
        return;
    }
    if (c->slots == 0 && !c->edges) return; // stays until another run needs the place
    memcpy(acc_slot_data(self, self->open) + acc_slot_tail(self), acc_x(self), acc_lag_count(self) * sizeof(double));
    if (c->slots == 0) {
        fold_slot_into_base(self, c->forgetting < 1 ? pow(c->forgetting, (double)slot->rows) : 1);
        okid_accumulator_clear_slot(self, self->open, joined);
        return;
    }
    self->closed += 1;
    self->open = (self->open + 1) % self->slot_count;
    const int64_t window = (int64_t)c->slots * c->block;
    while (self->closed == self->slot_count ||
           (self->closed > 0 && self->clock - acc_slot(self, acc_oldest(self))->start > window))
        drop_oldest(self);
    okid_accumulator_clear_slot(self, self->open, joined);
}

/// self.base += other.base, exact or double as both are.
static void add_base(okid_accumulator_t* self, const okid_accumulator_t* other) {
    const size_t sums = acc_sum_count(self), packed = acc_edge_count(self), edge = acc_base_edge(self);
    if (!acc_base_is_exact(self)) {
        double* to = acc_base(self);
        const double* from = acc_base(other);
        for (size_t i = 0; i < edge + packed; ++i) to[i] += from[i];
        return;
    }
    int64_t* to = (int64_t*)acc_base(self);
    const int64_t* from = (const int64_t*)acc_base(other);
    for (size_t i = 0; i < sums; ++i) wide_add_wide(to + sums + i, to + i, from[sums + i], from[i]);
    for (size_t i = acc_base_sum(self); i < edge; ++i) to[i] += from[i];
    for (size_t i = edge; i < edge + packed; ++i) wide_add_wide(to + packed + i, to + i, from[packed + i], from[i]);
}

/// The open slot of `other` becomes a closed record of `self`.
static void adopt_open_slot(okid_accumulator_t* self, const okid_accumulator_t* other) {
    if (acc_slot(other, other->open)->rows == 0) return;
    memcpy(acc_slot(self, self->open), acc_slot(other, other->open), (size_t)self->slot_numbers * sizeof(double));
    memcpy(acc_slot_data(self, self->open) + acc_slot_tail(self), acc_x(other), acc_lag_count(self) * sizeof(double));
    fold_slot_into_base(self, 1);
    okid_accumulator_clear_slot(self, self->open, 0);
}

okid_status_t okid_accumulator_merge(okid_accumulator_t* self, okid_accumulator_t* other) {
    if (!self || !other) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &other->config;
    if (a->n_u != b->n_u || a->n_y != b->n_y || a->lags != b->lags || a->sample != b->sample || !a->edges ||
        !b->edges || a->slots || b->slots || a->forgetting != 1 || b->forgetting != 1 || self == other)
        return OKID_ERR_MISMATCH;
    const int empty = self->stats.rows == 0 && self->stats.samples == 0;
    if (self->centred != other->centred && !empty && other->stats.rows > 0) return OKID_ERR_MISMATCH;
    if (self->stats.rows > INT64_MAX / 2 - other->stats.rows) return OKID_ERR_RANGE;
    if (empty) self->centred = other->centred;
    okid_accumulator_close_slot(self, 0);
    self->have = 0;
    self->in_gap = 1;
    okid_accumulator_settle(other);
    add_base(self, other);
    self->base_weight += other->base_weight;
    adopt_open_slot(self, other);
    self->stats.samples += other->stats.samples;
    self->stats.missing += other->stats.missing;
    self->stats.gaps += other->stats.gaps;
    self->stats.saturated += other->stats.saturated;
    self->stats.rows += other->stats.rows;
    self->clock += other->clock;
    acc_slot(self, self->open)->start = self->clock;
    return OKID_OK;
}
