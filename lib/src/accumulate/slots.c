// SPDX-License-Identifier: MIT
// PURPOSE    what happens when an unbroken piece of the record ends: into the ring, or into the base; records and parts of
//            records added and taken away
// METHOD     window: whole slots fall out of a ring, nothing is subtracted in it. Growing: base += slot, and the ends of the
//            run go into the edge Gram as outer products. Forgetting: base *= lambda^rows before
// REFERENCE  docs/decisions/0001-gap-closes-a-slot.md
// NUMERICS   codes: exact (wide.h); doubles: one addition a slot
// WORKSPACE  none; (p m)^2 flop a run
#include "accumulator.h"
#include "counts.h"
#include "wide.h"

#include <math.h>

void okid_accumulator_clear_slot(okid_accumulator_t* self, int32_t index, int joined) {
    slot_info_t* slot = acc_slot(self, index);
    memset(slot, 0, (size_t)self->slot_numbers * sizeof(double));
    slot->joined = joined;
    slot->start = self->clock - self->pending;
}

/// Samples of the lag window that are older than ours, of sums `from` that have as many lags or more.
static size_t older_lags(const okid_accumulator_t* a, const okid_accumulator_t* from) {
    return (size_t)(from->config.lags - a->config.lags);
}

/// Where row r of our sums begins in those of `from`: lags stand in time order, ours are the newest.
static size_t row_in(const okid_accumulator_t* a, const okid_accumulator_t* from, size_t r) {
    return r * (size_t)from->width + older_lags(a, from) * (size_t)a->m;
}

/// base = keep * base + gain * (sums at `data` of `from`, S and then the sums of the channels, in a slot or in its base).
/// Codes without forgetting: exact, keep 1, gain 1 or -1. @param exact  they are pairs of words
static void add_sums(okid_accumulator_t* a, const okid_accumulator_t* from, const double* data, int exact, double keep,
                     double gain) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, sums = acc_sum_count(a), its = acc_sum_count(from),
                 at = exact ? 2 * its : its;
    const int64_t* codes = (const int64_t*)data;
    if (acc_base_is_exact(a)) {
        int64_t* base = (int64_t*)acc_base(a);
        const int64_t sign = gain < 0 ? -1 : 1;
        for (size_t r = 0; r < m; ++r)
            for (size_t i = r * n, k = row_in(a, from, r); i < (r + 1) * n; ++i, ++k)
                wide_add_wide(base + sums + i, base + i, sign * codes[its + k], sign * codes[k]);
        for (size_t r = 0; r < m; ++r) base[acc_base_sum(a) + r] += sign * codes[at + r];
        return;
    }
    double *base = acc_base(a), *sum = base + acc_base_sum(a);
    for (size_t r = 0; r < m; ++r)
        for (size_t i = r * n, k = row_in(a, from, r); i < (r + 1) * n; ++i, ++k)
            base[i] = keep * base[i] + gain * (exact ? wide_double(codes[its + k], codes[k]) : data[k]);
    for (size_t r = 0; r < m; ++r) sum[r] = keep * sum[r] + gain * (exact ? (double)codes[at + r] : data[at + r]);
}

/// Exact: the outer products of one end of a run into the edge Gram, `sign` 1 for a head, -1 for a tail.
static void add_end_exact(okid_accumulator_t* a, const double* end, int64_t sign) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags, packed = acc_edge_count(a);
    int64_t *base = (int64_t*)acc_base(a), *low = base + acc_base_edge(a), *high = low + packed,
            *edge_sum = base + acc_base_edge_sum(a);
    for (size_t lj = 0; lj < p; ++lj)
        for (size_t cj = 0; cj < m; ++cj) {
            const size_t j = lj * m + cj, column = j * (j + 1) / 2;
            const int64_t xj = sign * acc_code(end + acc_end(a, lj, cj));
            edge_sum[j] += xj;
            for (size_t li = 0, i = 0; li <= lj; ++li) {
                const double* x = end + acc_end(a, li, 0);
                for (size_t ci = 0; ci < m && i <= j; ++ci, ++i)
                    wide_add(high + column + i, low + column + i, acc_code(x + ci) * xj);
            }
        }
}

/// The same in double: edge = keep * edge + sign * products.
static void add_end_double(okid_accumulator_t* a, const double* end, double keep, double sign) {
    const size_t m = (size_t)a->m, p = (size_t)a->config.lags;
    double *base = acc_base(a), *edge = base + acc_base_edge(a), *edge_sum = base + acc_base_edge_sum(a);
    for (size_t lj = 0; lj < p; ++lj)
        for (size_t cj = 0; cj < m; ++cj) {
            const size_t j = lj * m + cj;
            const double xj = sign * acc_number(a, end + acc_end(a, lj, cj));
            edge_sum[j] = keep * edge_sum[j] + xj;
            double* column = edge + j * (j + 1) / 2;
            for (size_t li = 0, i = 0; li <= lj; ++li) {
                const double* x = end + acc_end(a, li, 0);
                for (size_t ci = 0; ci < m && i <= j; ++ci, ++i)
                    column[i] = keep * column[i] + acc_number(a, x + ci) * xj;
            }
        }
}

/// A slot of `from` into the base: base = keep * base + gain * slot. An end that meets a neighbour's is NULL: there both cancel.
static void fold_slot(okid_accumulator_t* a, const okid_accumulator_t* from, const acc_piece_t* piece, int64_t rows,
                      double keep, double gain) {
    add_sums(a, from, piece->data, acc_has_codes(from), keep, gain);
    for (int end = 0; end < 2; ++end) {
        const double* at = end == 0 ? piece->head : piece->tail;
        const double sign = end == 0 ? gain : -gain;
        if (at) at += older_lags(a, from) * (size_t)a->m;
        if (at && acc_base_is_exact(a))
            add_end_exact(a, at, sign < 0 ? -1 : 1);
        else if (at)
            add_end_double(a, at, end == 0 ? keep : 1, sign);
    }
    a->base_weight = a->base_weight * keep + gain * (double)rows;
}

/// The open slot as a run of its own.
static acc_piece_t open_piece(const okid_accumulator_t* a) {
    const double* data = acc_slot_data(a, a->open);
    return (acc_piece_t){data, data + acc_slot_head(a), acc_x(a)};
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
    if (c->slots == 0) {
        const acc_piece_t piece = open_piece(self);
        fold_slot(self, self, &piece, slot->rows, c->forgetting < 1 ? pow(c->forgetting, (double)slot->rows) : 1, 1);
        okid_accumulator_clear_slot(self, self->open, joined);
        return;
    }
    memcpy(acc_slot_data(self, self->open) + acc_slot_tail(self), acc_x(self), acc_lag_count(self) * sizeof(double));
    self->closed += 1;
    self->open = (self->open + 1) % self->slot_count;
    const int64_t window = (int64_t)c->slots * c->block;
    while (self->closed == self->slot_count ||
           (self->closed > 0 && self->clock - acc_slot(self, acc_oldest(self))->start > window))
        drop_oldest(self);
    okid_accumulator_clear_slot(self, self->open, joined);
}

/// self.base += gain * other.base, exact (gain 1 or -1) or double as both are. The ends of runs stand by lag: ours come first.
static void add_base(okid_accumulator_t* self, const okid_accumulator_t* other, double gain) {
    const size_t ends = acc_lag_count(self), packed = acc_edge_count(self), its_packed = acc_edge_count(other);
    const int exact = acc_base_is_exact(self);
    self->base_weight += gain * other->base_weight;
    add_sums(self, other, acc_base(other), exact, 1, gain);
    if (!exact) {
        double *sum = acc_base(self) + acc_base_edge_sum(self), *edge = acc_base(self) + acc_base_edge(self);
        const double *its_sum = acc_base(other) + acc_base_edge_sum(other),
                     *its_edge = acc_base(other) + acc_base_edge(other);
        for (size_t i = 0; i < ends; ++i) sum[i] += gain * its_sum[i];
        for (size_t i = 0; i < packed; ++i) edge[i] += gain * its_edge[i];
        return;
    }
    const int64_t sign = gain < 0 ? -1 : 1;
    int64_t *sum = (int64_t*)acc_base(self) + acc_base_edge_sum(self),
            *edge = (int64_t*)acc_base(self) + acc_base_edge(self);
    const int64_t *its_sum = (const int64_t*)acc_base(other) + acc_base_edge_sum(other),
                  *its_edge = (const int64_t*)acc_base(other) + acc_base_edge(other);
    for (size_t i = 0; i < ends; ++i) sum[i] += sign * its_sum[i];
    for (size_t i = 0; i < packed; ++i)
        wide_add_wide(edge + packed + i, edge + i, sign * its_edge[its_packed + i], sign * its_edge[i]);
}

/// Everything of `other` into the base, its open slot as a closed record.
static void add_all(okid_accumulator_t* self, okid_accumulator_t* other, double gain) {
    okid_accumulator_settle(other);
    add_base(self, other, gain);
    const int64_t rows = acc_slot(other, other->open)->rows;
    const acc_piece_t piece = open_piece(other);
    if (rows > 0) fold_slot(self, other, &piece, rows, 1, gain);
}

static void add_counts(okid_accumulator_t* self, const okid_accumulator_t* other, int64_t sign) {
    okid_accumulator_stats_t* s = &self->stats;
    s->samples += sign * other->stats.samples;
    s->missing += sign * other->stats.missing;
    s->gaps += sign * other->stats.gaps;
    s->saturated += sign * other->stats.saturated;
    s->rows += sign * other->stats.rows;
    self->clock += sign * other->clock;
    acc_slot(self, self->open)->start = self->clock;
}

/// The open slot goes into the base as it stands beside it, nothing fades; the next sample begins another run.
static void end_run(okid_accumulator_t* self) {
    okid_accumulator_settle(self);
    const int64_t rows = acc_slot(self, self->open)->rows;
    const acc_piece_t piece = open_piece(self);
    if (rows > 0) fold_slot(self, self, &piece, rows, 1, 1);
    okid_accumulator_clear_slot(self, self->open, 0);
    self->have = 0;
    self->in_gap = 1;
}

/// Same channels and samples, and no lag fewer in the other?
static int alike(const okid_accumulator_t* self, const okid_accumulator_t* other) {
    const okid_accumulator_config_t *a = &self->config, *b = &other->config;
    return a->n_u == b->n_u && a->n_y == b->n_y && a->lags <= b->lags && a->sample == b->sample && self != other;
}

okid_status_t okid_accumulator_merge(okid_accumulator_t* self, okid_accumulator_t* other) {
    if (!self || !other) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &other->config;
    if (!alike(self, other) || !a->edges || !b->edges || a->slots || b->slots || a->forgetting != 1 ||
        b->forgetting != 1)
        return OKID_ERR_MISMATCH;
    const int empty = self->stats.rows == 0 && self->stats.samples == 0;
    if (self->centred != other->centred && !empty && other->stats.rows > 0) return OKID_ERR_MISMATCH;
    if (!counts_fit(&self->stats, &other->stats, row_limit(a->sample), self->clock, other->clock))
        return OKID_ERR_RANGE;
    if (empty) self->centred = other->centred;
    end_run(self);
    add_all(self, other, 1);
    add_counts(self, other, 1);
    return OKID_OK;
}

okid_status_t okid_accumulator_remove(okid_accumulator_t* self, okid_accumulator_t* part, double weight) {
    if (!self || !part) return OKID_ERR_NULL;
    const okid_accumulator_config_t *a = &self->config, *b = &part->config;
    if (!alike(self, part) || a->lags != b->lags || !a->edges || !b->edges || a->slots || b->slots ||
        a->forgetting != b->forgetting || self->stats.rows < part->stats.rows ||
        (part->stats.rows > 0 && self->centred != part->centred))
        return OKID_ERR_MISMATCH;
    if (!(weight > 0 && weight <= 1) || (weight < 1 && a->forgetting == 1)) return OKID_ERR_RANGE;
    end_run(self);
    add_all(self, part, -weight);
    add_counts(self, part, -1);
    if (self->stats.rows == 0) { // doubles leave their rounding
        memset(acc_base(self), 0, (acc_base_edge(self) + acc_edge_count(self) * (acc_base_is_exact(self) ? 2 : 1)) * 8);
        self->base_weight = 0;
    }
    return OKID_OK;
}

int32_t okid_accumulator_slots(const okid_accumulator_t* self) { return self ? self->closed + 1 : 0; }

int64_t okid_accumulator_slot_rows(const okid_accumulator_t* self, int32_t k) {
    if (!self || k < 0 || k > self->closed) return 0;
    return acc_slot(self, acc_ring(self, k))->rows + (k == self->closed ? self->pending : 0);
}

okid_status_t okid_accumulator_take_slots(okid_accumulator_t* self, okid_accumulator_t* from, int32_t first,
                                          int32_t count) {
    if (!self || !from) return OKID_ERR_NULL;
    const okid_accumulator_config_t* a = &self->config;
    if (!alike(self, from) || !a->edges || a->slots || a->forgetting != 1 || self->centred || from->centred)
        return OKID_ERR_MISMATCH;
    if (first < 0 || count < 0 || first > from->closed + 1 - count) return OKID_ERR_DIM;
    end_run(self);
    okid_accumulator_settle(from);
    for (int32_t k = first; k < first + count; ++k) {
        acc_piece_t piece;
        if (!acc_piece(from, k, &piece)) continue;
        const slot_info_t* slot = acc_slot(from, acc_ring(from, k));
        if (k == first) piece.head = piece.data + acc_slot_head(from);
        if (k == first + count - 1) piece.tail = acc_tail(from, acc_ring(from, k));
        fold_slot(self, from, &piece, slot->rows, 1, 1);
        self->stats.rows += slot->rows;
        self->stats.samples += slot->rows;
        self->clock += slot->rows;
    }
    acc_slot(self, self->open)->start = self->clock;
    return OKID_OK;
}

okid_status_t okid_accumulator_drop_slots(okid_accumulator_t* self, int32_t count) {
    if (!self) return OKID_ERR_NULL;
    if (count < 0 || count > self->closed) return OKID_ERR_DIM;
    for (int32_t k = 0; k < count; ++k) drop_oldest(self);
    return OKID_OK;
}

/// A slot takes in the one that continues it.
static void join_slots(okid_accumulator_t* a, int32_t first, int32_t second) {
    const size_t sums = acc_sum_count(a), at = acc_slot_sum(a), m = (size_t)a->m;
    double* to = acc_slot_data(a, first);
    const double* from = acc_slot_data(a, second);
    if (acc_has_codes(a)) {
        int64_t* low = (int64_t*)to;
        const int64_t* its = (const int64_t*)from;
        for (size_t i = 0; i < sums; ++i) wide_add_wide(low + sums + i, low + i, its[sums + i], its[i]);
        for (size_t r = 0; r < m; ++r) low[at + r] += its[at + r];
    } else {
        for (size_t i = 0; i < at + m; ++i) to[i] += from[i];
    }
    memcpy(to + acc_slot_tail(a), from + acc_slot_tail(a), acc_lag_count(a) * sizeof(double));
    acc_slot(a, first)->rows += acc_slot(a, second)->rows;
}

okid_status_t okid_accumulator_pair_slots(okid_accumulator_t* self) {
    if (!self) return OKID_ERR_NULL;
    if (self->config.slots == 0) return OKID_ERR_MISMATCH;
    if (self->config.block > INT32_MAX / 2) return OKID_ERR_RANGE;
    okid_accumulator_settle(self);
    const int32_t oldest = acc_oldest(self), all = self->slot_count;
    int32_t kept = 0; // slots that stand in their new places
    for (int32_t k = 0; k <= self->closed; ++kept) {
        const int32_t to = (oldest + kept) % all, from = (oldest + k++) % all, next = (oldest + k) % all;
        if (to != from) memcpy(acc_slot(self, to), acc_slot(self, from), (size_t)self->slot_numbers * sizeof(double));
        if (k < self->closed && acc_slot(self, next)->joined) join_slots(self, to, (oldest + k++) % all);
    }
    self->closed = kept - 1;
    self->open = (oldest + self->closed) % all;
    self->config.block *= 2;
    return OKID_OK;
}
