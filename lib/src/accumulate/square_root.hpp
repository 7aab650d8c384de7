// SPDX-License-Identifier: MIT
// PURPOSE    memory map of a square-root accumulator, shared by what absorbs samples (square_root.cpp) and what makes
//            results of the factor (square_root_result.cpp)
#pragma once
#include <okid/steps/square_root.h>

#include "accumulate/householder.h"

/// Rows of one piece of the record; its triangle stands behind it in memory. Growing: one slot for everything.
/// Forgetting: slot 0 fades, slot 1 is open. Window: a ring.
struct square_root_slot {
    int64_t rows;
    int64_t start; ///< sample clock at its first row
};

struct okid_square_root {
    okid_square_root_config_t config;
    okid_accumulator_stats_t stats;
    size_t scale_at, reference_at, samples_at, window_at, rows_at, panel_at, wide_at, slots_at, slot_bytes,
        whole_at;             ///< bytes from this struct
    size_t stride;            ///< columns of a triangle, padding included
    int64_t clock;            ///< samples seen, missing ones included
    int32_t m, n, q;          ///< channels; numbers in [v_n; ..; v_(n-p)], the column of ones not counted; regressors
    int32_t slot_count, open; ///< ring; closed slots stand before `open`
    int32_t closed, have;     ///< closed slots; samples of the lag window at hand
    int32_t pending, in_gap;  ///< samples waiting behind the window; the run has ended, the next sample begins another
    int32_t referenced;       ///< the reference of each channel is known

    template <class T> T* at(size_t offset) {
        return reinterpret_cast<T*>(reinterpret_cast<unsigned char*>(this) + offset);
    }
    template <class T> const T* at(size_t offset) const {
        return reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(this) + offset);
    }
    double* scale() { return at<double>(scale_at); }         ///< m scales, m offsets
    double* reference() { return at<double>(reference_at); } ///< m
    double* samples() { return at<double>(samples_at); }     ///< (p + batch) m as they came, in time order
    double* wide() { return at<double>(wide_at); }           ///< at least 9 n and p numbers of scratch
    square_root_slot* slot(int32_t index) {
        return at<square_root_slot>(slots_at + slot_bytes * static_cast<size_t>(index));
    }
    okid_real_t* triangle(int32_t index);
    int32_t oldest() const { return (open - closed + slot_count) % slot_count; }

    /// Channel of column i + 1 of the factor.
    int32_t channel(int32_t i) const { return i < config.n_u ? i : i < q ? (i - config.n_u) % m : config.n_u + i - q; }
};

namespace okid {

/// Bring the samples that wait into the factor of the open slot.
void square_root_settle(okid_square_root& a);

/// The factor of everything in the sums: that of the only slot with rows, else all of them stacked in `whole`.
const okid_real_t* square_root_whole(okid_square_root& a);

} // namespace okid
