// SPDX-License-Identifier: MIT
// PURPOSE    memory map of the correlation sums, shared by samples (correlation.c), their reading (correlation_sums.c) and their
//            written form (correlation_serial.c)
#ifndef OKID_CORRELATION_PRIVATE_H
#define OKID_CORRELATION_PRIVATE_H

#include <okid/correlation.h>

#include "wide.h"

#include <string.h>

/// Codes stand everywhere as 64-bit integers, samples as doubles: one number either way.
typedef union cor_number_t {
    double real;
    int64_t code;
} cor_number_t;

/// What is known of an unbroken piece of the record beside its sums; head and tail (cor_end_count() numbers each: the last L
/// inputs, then the last own_lags outputs, in time order) follow in memory.
typedef struct cor_slot_t {
    int64_t rows;
} cor_slot_t;

/// Sums: U, Y, then T, row-major, rows of w (lags + 1), oldest lag first; codes: low words of all, then high words; then m sums.
struct okid_correlation {
    okid_correlation_config_t config;
    okid_accumulator_stats_t stats;
    int64_t clock, unfolded; ///< samples seen; rows in the low words since the last fold
    uint32_t scale_at, tables_at, now_at, u_at, y_at, slots_at, sums_at, spectrum_at, kept_at; ///< from it, in numbers
    uint32_t slot_numbers, sums_numbers;
    int32_t m, ring, oldest, closed; ///< the open slot follows the closed ones; none is open when closed = ring
    int32_t buffer;                  ///< samples that may wait
    int32_t points;                  ///< of a transform; 0: sums are made directly
    int32_t gathered;                ///< rows in the cross-spectra
    double energy;                   ///< codes: of those rows, for okid_spectrum_error()
    int32_t have, pending, in_gap;   ///< samples of the lag window at hand; waiting behind it; between two runs
};

static inline cor_number_t* cor_at(const okid_correlation_t* s, uint32_t at) { return (cor_number_t*)(size_t)s + at; }
static inline double* cor_scale(const okid_correlation_t* s) { return &cor_at(s, s->scale_at)->real; }
static inline int cor_codes(const okid_correlation_t* s) { return s->config.sample != OKID_SAMPLE_DOUBLE; }
static inline int cor_planes(const okid_correlation_t* s) { return cor_codes(s) ? 2 : 1; }
static inline size_t cor_u_window(const okid_correlation_t* s) {
    return (size_t)s->config.n_u * (size_t)s->config.lags;
}
static inline size_t cor_y_window(const okid_correlation_t* s) {
    return (size_t)s->config.n_y * (size_t)s->config.own_lags;
}
static inline size_t cor_end_count(const okid_correlation_t* s) { return cor_u_window(s) + cor_y_window(s); }
static inline size_t cor_u_count(const okid_correlation_t* s) {
    return (size_t)s->m * (cor_u_window(s) + (size_t)s->config.n_u);
}
static inline size_t cor_t_at(const okid_correlation_t* s) {
    return cor_u_count(s) + (size_t)s->m * (cor_y_window(s) + (size_t)s->config.n_y);
}
static inline size_t cor_sum_count(const okid_correlation_t* s) {
    return cor_t_at(s) + (size_t)s->config.n_u * (cor_u_window(s) + (size_t)s->config.n_u);
}
/// Sets of sums: one for all, or one a slot.
static inline int32_t cor_sets(const okid_correlation_t* s) { return s->config.block > 0 ? s->ring : 1; }
/// The k-th slot, oldest first; k = closed is the open one.
static inline int32_t cor_index(const okid_correlation_t* s, int32_t k) { return (s->oldest + k) % s->ring; }
static inline cor_slot_t* cor_slot(const okid_correlation_t* s, int32_t k) {
    return (cor_slot_t*)cor_at(s, s->slots_at + s->slot_numbers * (uint32_t)cor_index(s, k));
}
static inline cor_number_t* cor_head(const okid_correlation_t* s, int32_t k) {
    return (cor_number_t*)(cor_slot(s, k) + 1);
}
static inline cor_number_t* cor_tail(const okid_correlation_t* s, int32_t k) {
    return cor_head(s, k) + cor_end_count(s);
}
/// The set of sums that slot k adds to.
static inline cor_number_t* cor_sums(const okid_correlation_t* s, int32_t k) {
    return cor_at(s, s->sums_at + s->sums_numbers * (uint32_t)(s->config.block > 0 ? cor_index(s, k) : 0));
}
/// Slots that hold rows, once settled.
static inline int32_t cor_pieces(const okid_correlation_t* s) {
    return s->closed + (s->closed < s->ring && cor_slot(s, s->closed)->rows > 0);
}

#ifdef OKID_INTEGER_KERNEL // no double arithmetic, no transforms
static inline int32_t okid_correlation_points(const okid_correlation_config_t* config) { return 0 * config->lags; }
static inline size_t okid_correlation_spectrum_numbers(const okid_correlation_t* self) { return 0 * (size_t)self->m; }
static inline int okid_correlation_gather(const okid_correlation_t* self) { return 0 * self->m; }
static inline void okid_correlation_bring_out(const okid_correlation_t* self) { (void)self; }
#else
/// Points of the transforms that sum faster than the direct kernel, 0: none does. numbers: of memory for them.
int32_t okid_correlation_points(const okid_correlation_config_t* config);
size_t okid_correlation_spectrum_numbers(const okid_correlation_t* self);
/// Gather the `pending` rows that wait; of codes the sums of before may go out. @return 0: they are to be summed directly
int okid_correlation_gather(okid_correlation_t* self);
/// Bring the sums of what was gathered out.
void okid_correlation_bring_out(okid_correlation_t* self);
#endif

/// Before and after a look at the sums of a run that goes on: numbers that transforms sum round, so that a look may not move
/// the blocks they stand in. What waits is summed for the look alone.
void okid_correlation_begin_look(okid_correlation_t* self);
void okid_correlation_end_look(okid_correlation_t* self);

/// Sum what waits, bring the low words of the open set into their range, and keep the tail of the open slot up to date.
void okid_correlation_settle(okid_correlation_t* self);

#endif
