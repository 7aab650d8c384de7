// SPDX-License-Identifier: MIT
// PURPOSE    memory map of an accumulator, shared by the per-sample part (accumulator.c), what happens when a run ends
//            (slots.c) and the Gram matrix (gram.c)
#ifndef OKID_ACCUMULATOR_PRIVATE_H
#define OKID_ACCUMULATOR_PRIVATE_H

#include <okid/accumulator.h>

#include "kernel.h"
#include "spectrum.h"

/// An unbroken piece of the record. Behind it in memory: S (m x m(p+1) row-major; codes: plane of low words, then plane of
/// high words), the sum of v_n over its rows (m; codes: int64), head (the p samples before its first row) and tail (the
/// last p samples), both in time order, as doubles (exact for every code).
typedef struct slot_info_t {
    int64_t rows;
    int64_t start;  ///< sample clock at its first row
    int64_t joined; ///< 1 = continues the slot before it: head equals that slot's tail
} slot_info_t;

/// Base sums, where the configuration has them: S, sum (m), edge sums (p m: heads less tails by lag), edge Gram (packed
/// upper triangle, p m (p m + 1)/2). Codes without forgetting: S and edge Gram as planes, the sums int64; else doubles.
struct okid_accumulator {
    okid_accumulator_config_t config;
    okid_accumulator_stats_t stats;
    spectrum_plan_t plan; ///< of the FFT path
    double energy;        ///< of the samples in the spectra, 0 = none
    size_t scale_at, x_at, scratch_at, partial_at, split_at, spectrum_at, slots_at, base_at,
        slot_bytes;                              ///< bytes from this struct
    size_t slot_mean, slot_head, slot_tail;      ///< in numbers from the slot's data
    size_t base_mean, base_edge_mean, base_edge; ///< in numbers from the base
    int64_t clock;                               ///< samples seen, missing ones included
    double base_weight;                          ///< rows in the base, forgotten ones fading
    int32_t m, width;                            ///< channels, m (p+1)
    int32_t slot_count, open, closed;            ///< ring; closed slots stand before `open`
    int32_t have, pending;                       ///< samples of the lag window at hand; samples waiting behind it
    int32_t partial_rows;                        ///< codes: rows in the double sums not yet folded
    int32_t in_gap;                              ///< the run has ended; the next sample begins another
};

static inline double* acc_at(const okid_accumulator_t* a, size_t offset) {
    return (double*)((char*)(size_t)a + offset);
}
static inline double* acc_scale(const okid_accumulator_t* a) { return acc_at(a, a->scale_at); }
static inline double* acc_x(const okid_accumulator_t* a) { return acc_at(a, a->x_at); }
static inline double* acc_scratch(const okid_accumulator_t* a) { return acc_at(a, a->scratch_at); } ///< 2 m (p+1)
static inline double* acc_base(const okid_accumulator_t* a) { return acc_at(a, a->base_at); }
static inline slot_info_t* acc_slot(const okid_accumulator_t* a, int32_t index) {
    return (slot_info_t*)acc_at(a, a->slots_at + a->slot_bytes * (size_t)index);
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

/// Reorder the p samples of `ends` (time order) into the lag vector [v_(n-1); ..; v_(n-p)].
void okid_accumulator_lag_vector(const okid_accumulator_t* a, const double* ends, double* out);

/// Bring everything that waits into the sums of the open slot.
void okid_accumulator_settle(okid_accumulator_t* self);

/// End the open slot. `joined`: the next one continues the same run.
void okid_accumulator_close_slot(okid_accumulator_t* self, int joined);

/// Empty the slot; it begins at the sample clock.
void okid_accumulator_clear_slot(okid_accumulator_t* self, int32_t index, int joined);

#endif
