// SPDX-License-Identifier: MIT
// PURPOSE    memory map of an accumulator, shared by the per-sample part (accumulator.c) and the Gram matrix (gram.c)
#ifndef OKID_ACCUMULATOR_PRIVATE_H
#define OKID_ACCUMULATOR_PRIVATE_H

#include <okid/accumulator.h>

#include "kernel.h"

/// An unbroken piece of the record. Behind it in memory: S (m x m(p+1) row-major, double or int64), the sum of v_n over
/// its rows (m), head (the p samples before its first row) and tail (the last p samples), both in time order.
typedef struct slot_info_t {
    int64_t rows;
    int64_t start;  ///< sample clock at its first row
    int64_t joined; ///< 1 = continues the slot before it: head equals that slot's tail
} slot_info_t;

/// Base sums, where the configuration has them: S, sum (m), edge sums (p m: heads less tails by lag), edge Gram (packed
/// upper triangle, p m (p m + 1)/2). S and edge Gram are int64 for codes without forgetting, else double.
struct okid_accumulator {
    okid_accumulator_config_t config;
    okid_accumulator_stats_t stats;
    okid_kernel_fn* kernel;
    size_t scale_at, x_at, sums_at, partial_at, slots_at, base_at, slot_bytes; ///< byte offsets from this struct
    size_t slot_head, slot_tail;                                               ///< in numbers from the slot's data
    int64_t clock;                                                             ///< samples seen, missing ones included
    double base_weight;               ///< rows in the base, forgotten ones fading
    int32_t m, width;                 ///< channels, m (p+1)
    int32_t slot_count, open, closed; ///< ring; closed slots stand before `open`
    int32_t have, pending;            ///< samples of the lag window at hand; samples waiting behind it for the kernel
    int32_t partial_rows;             ///< codes: rows in the double sums not yet folded
    int32_t in_gap;                   ///< the run has ended; the next sample begins another
};

static inline double* acc_at(const okid_accumulator_t* a, size_t offset) {
    return (double*)((char*)(size_t)a + offset);
}
static inline double* acc_scale(const okid_accumulator_t* a) { return acc_at(a, a->scale_at); }
static inline double* acc_x(const okid_accumulator_t* a) { return acc_at(a, a->x_at); }
static inline double* acc_sums(const okid_accumulator_t* a) { return acc_at(a, a->sums_at); }
static inline double* acc_partial(const okid_accumulator_t* a) { return acc_at(a, a->partial_at); }
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
static inline int acc_base_is_integer(const okid_accumulator_t* a) {
    return a->config.sample == OKID_SAMPLE_INT16 && a->config.forgetting >= 1;
}
/// Entry i = lag*m + channel of the lag vector [v_(n-1); ..; v_(n-p)] whose samples stand in time order in `ends`.
static inline double acc_lag(const double* ends, size_t i, int32_t m, int32_t p) {
    const size_t lag = i / (size_t)m, channel = i % (size_t)m;
    return ends[((size_t)p - 1 - lag) * (size_t)m + channel];
}

/// Bring everything that waits into the sums of the open slot.
void okid_accumulator_settle(okid_accumulator_t* self);

#endif
