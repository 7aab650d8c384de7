// SPDX-License-Identifier: MIT
// PURPOSE    memory map of an accumulator, shared by its life (accumulator.c), the per-sample part (absorb.c), what happens
//            when a run ends (slots.c), the Gram matrix (gram.c), offsets (centre.c) and its written form (serial.c)
#ifndef OKID_ACCUMULATOR_PRIVATE_H
#define OKID_ACCUMULATOR_PRIVATE_H

#include <okid/accumulator.h>

#include "kernel.h"
#include "spectrum.h"

#include <string.h>

enum { ACC_BUFFER = 256, ACC_CENTRED_BITS = 8 };

#ifdef OKID_INTEGER_KERNEL // no double arithmetic, no FFT path: the compiler drops it
enum { ACC_HAS_BULK = 0 };
#else
enum { ACC_HAS_BULK = 1 };
#endif
static inline int acc_bulk_on(const okid_accumulator_config_t* c) { return ACC_HAS_BULK && c->bulk; }

/// An unbroken piece of the record. Behind it in memory: S (m x m(p+1) row-major; codes: plane of low words, then plane of
/// high words), the sum of v_n over its rows (m; codes: int64), head (the p samples before its first row) and tail (the
/// last p samples; only with a ring or a base), both in time order.
typedef struct slot_info_t {
    int64_t rows;
    int64_t start;  ///< sample clock at its first row
    int64_t joined; ///< 1 = continues the slot before it: head equals that slot's tail
} slot_info_t;

/// What the FFT path keeps before its tables.
typedef struct bulk_t {
    spectrum_plan_t plan;
    double energy; ///< of the samples in the spectra, 0 = none
} bulk_t;

/// Base sums, where the configuration has them: S, sum (m), edge sums (p m: heads less tails by lag), edge Gram (packed
/// upper triangle, p m (p m + 1)/2). Codes without forgetting: S and edge Gram as planes, the sums int64; else doubles.
struct okid_accumulator {
    okid_accumulator_config_t config;
    okid_accumulator_stats_t stats;
    int64_t clock;      ///< samples seen, missing ones included
    double base_weight; ///< rows in the base, forgotten ones fading
    uint32_t scale_at, x_at, partial_at, split_at, bulk_at, slots_at, base_at; ///< from this struct, in numbers
    uint32_t slot_numbers;                                                     ///< size of a slot in numbers
    int32_t m, width;                                                          ///< channels, m (p+1)
    int32_t slot_count, open, closed; ///< ring; closed slots stand before `open`
    int32_t have, pending;            ///< samples of the lag window at hand; samples waiting behind it
    int32_t in_gap;                   ///< the run has ended; the next sample begins another
    int32_t centred;                  ///< centre() has removed the means: takes no more samples, only merges
    int64_t partial_rows;             ///< codes: rows in the sums not yet folded
};

static inline double* acc_at(const okid_accumulator_t* a, uint32_t offset) { return (double*)(size_t)a + offset; }
static inline double* acc_scale(const okid_accumulator_t* a) { return acc_at(a, a->scale_at); }
static inline double* acc_x(const okid_accumulator_t* a) { return acc_at(a, a->x_at); }
static inline double* acc_base(const okid_accumulator_t* a) { return acc_at(a, a->base_at); }
static inline bulk_t* acc_bulk(const okid_accumulator_t* a) { return (bulk_t*)acc_at(a, a->bulk_at); }
static inline double* acc_spectra(const okid_accumulator_t* a) {
    return acc_at(a, a->bulk_at) + sizeof(bulk_t) / sizeof(double);
}
static inline slot_info_t* acc_slot(const okid_accumulator_t* a, int32_t index) {
    return (slot_info_t*)(acc_at(a, a->slots_at) + (size_t)a->slot_numbers * (size_t)index);
}
static inline double* acc_slot_data(const okid_accumulator_t* a, int32_t index) {
    return (double*)(acc_slot(a, index) + 1);
}
static inline int32_t acc_oldest(const okid_accumulator_t* a) {
    return (a->open - a->closed + a->slot_count) % a->slot_count;
}
static inline int acc_has_codes(const okid_accumulator_t* a) { return a->config.sample != OKID_SAMPLE_DOUBLE; }
static inline int acc_base_is_exact(const okid_accumulator_t* a) {
    return acc_has_codes(a) && a->config.forgetting >= 1;
}
static inline size_t acc_sum_count(const okid_accumulator_t* a) { return (size_t)a->m * (size_t)a->width; }
static inline size_t acc_lag_count(const okid_accumulator_t* a) { return (size_t)a->m * (size_t)a->config.lags; }
static inline size_t acc_edge_count(const okid_accumulator_t* a) {
    return acc_lag_count(a) * (acc_lag_count(a) + 1) / 2;
}

/// The base of codes counts in 2^-fraction codes once it is centred.
static inline int acc_fraction(const okid_accumulator_t* a) {
    return a->centred && acc_has_codes(a) ? ACC_CENTRED_BITS : 0;
}

// Places within a slot's data and within the base, in numbers.
static inline size_t acc_slot_sum(const okid_accumulator_t* a) { return acc_sum_count(a) * (acc_has_codes(a) ? 2 : 1); }
static inline size_t acc_slot_head(const okid_accumulator_t* a) { return acc_slot_sum(a) + (size_t)a->m; }
static inline size_t acc_slot_tail(const okid_accumulator_t* a) { return acc_slot_head(a) + acc_lag_count(a); }
static inline size_t acc_base_sum(const okid_accumulator_t* a) {
    return acc_sum_count(a) * (acc_base_is_exact(a) ? 2 : 1);
}
static inline size_t acc_base_edge_sum(const okid_accumulator_t* a) { return acc_base_sum(a) + (size_t)a->m; }
static inline size_t acc_base_edge(const okid_accumulator_t* a) { return acc_base_edge_sum(a) + acc_lag_count(a); }

/// A sample in the lag window, a head or a tail: doubles (exact for every code), but for codes in the integer kernel 64-bit
/// integers, because a processor without double arithmetic should not meet any.
static inline int64_t acc_code(const double* at) {
#ifdef OKID_INTEGER_KERNEL
    int64_t code;
    memcpy(&code, at, sizeof code);
    return code;
#else
    return (int64_t)*at;
#endif
}
static inline void acc_put_code(double* at, int64_t code) {
#ifdef OKID_INTEGER_KERNEL
    memcpy(at, &code, sizeof code);
#else
    *at = (double)code;
#endif
}
static inline double acc_number(const okid_accumulator_t* a, const double* at) {
    return acc_has_codes(a) ? (double)acc_code(at) : *at;
}

/// Place of channel c, lag l + 1 among p samples in time order.
static inline size_t acc_end(const okid_accumulator_t* a, size_t l, size_t c) {
    return ((size_t)a->config.lags - 1 - l) * (size_t)a->m + c;
}

/// Tail of a slot: stored for closed ones, the live lag window for the open one.
static inline const double* acc_tail(const okid_accumulator_t* a, int32_t index) {
    return index == a->open ? acc_x(a) : acc_slot_data(a, index) + acc_slot_tail(a);
}

/// The k-th slot of the ring, oldest first, k <= closed.
static inline int32_t acc_ring(const okid_accumulator_t* a, int32_t k) { return (acc_oldest(a) + k) % a->slot_count; }

/// Is the k-th slot of the ring continued without a gap by a slot that holds rows?
static inline int acc_is_continued(const okid_accumulator_t* a, int32_t k) {
    if (k >= a->closed) return 0;
    const slot_info_t* next = acc_slot(a, acc_ring(a, k + 1));
    return next->joined && next->rows > 0;
}

/// A slot of the ring as the Gram matrix sees it: its sums, and those ends of its run that do not meet a neighbour's (there
/// both cancel), else NULL.
typedef struct acc_piece_t {
    const double *data, *head, *tail;
} acc_piece_t;

/// The k-th slot of the ring, oldest first; 0 when it holds no rows.
static inline int acc_piece(const okid_accumulator_t* a, int32_t k, acc_piece_t* out) {
    const int32_t index = acc_ring(a, k);
    const slot_info_t* slot = acc_slot(a, index);
    out->data = acc_slot_data(a, index);
    out->head = k > 0 && slot->joined ? NULL : out->data + acc_slot_head(a);
    out->tail = acc_is_continued(a, k) ? NULL : acc_tail(a, index);
    return slot->rows > 0;
}

/// Bring everything that waits into the sums of the open slot.
void okid_accumulator_settle(okid_accumulator_t* self);

/// End the open slot. `joined`: the next one continues the same run.
void okid_accumulator_close_slot(okid_accumulator_t* self, int joined);

/// Empty the slot; it begins at the sample clock.
void okid_accumulator_clear_slot(okid_accumulator_t* self, int32_t index, int joined);

/// The mean of `rows` codes rounded to a whole one.
static inline int64_t okid_accumulator_whole_mean(int64_t sum, int64_t rows) {
    const int64_t low = sum / rows - (sum % rows < 0), rest = sum - low * rows;
    return low + (rest > rows / 2);
}

/// Rows in the sums, forgotten ones fading.
double okid_accumulator_weight(const okid_accumulator_t* a);

/// Sum of lag row i (channel i % m, lag i / m) over all rows, given the sum of the same channel one lag before:
/// g(lag + 1) = g(lag) + heads - tails of that lag. For codes without forgetting / for the rest.
int64_t okid_accumulator_lag_sum_exact(const okid_accumulator_t* a, size_t i, int64_t before);
double okid_accumulator_lag_sum(const okid_accumulator_t* a, size_t i, double before);

#endif
