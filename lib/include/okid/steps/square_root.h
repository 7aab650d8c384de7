// SPDX-License-Identifier: MIT
/// @file steps/square_root.h
/// The second recursive kernel: the triangular factor of the rows instead of their Gram matrix (block QR).
///
/// R with R^T R = sum w_n w_n^T is kept, the Gram matrix itself never: the condition of the data is not squared. For
/// processors with a single-precision unit only, for very lightly damped or noise-free records, and as the second opinion on
/// okid_accumulator_t. Cost: 2 N^2 flop a sample and about N^2/2 numbers with N = m(p+1) + 1; the accumulator needs 2 m N
/// and m N. A gap only re-arms the lag window; nothing is shift-structured.
///
/// The columns are [1, u_n, v_(n-1), .., v_(n-p), y_n]. The column of ones comes first: without the first row and column
/// R is the factor of the rows with their means removed. Samples are taken as they come and less a reference of each
/// channel (the median of the samples that fill the first lag window), so that no digit is spent on an offset; units and
/// the reference are put in at the end.
///
/// In float R^T R is right to 2e-6 of its diagonal after 10^4 rows and to 8e-6 after 10^6 (batch 32; half of it with 256).
///
/// Slots, gaps, window and forgetting mean what they mean in okid/accumulator.h, and the same record gives the same Gram
/// matrix to rounding. Rows wait until `batch` of them can be taken at once: how a record is cut into calls changes no
/// bit (as long as the factor is looked at after the same samples).
#ifndef OKID_STEPS_SQUARE_ROOT_H
#define OKID_STEPS_SQUARE_ROOT_H

#include <okid/identify.h>

#ifdef __cplusplus
extern "C" {
#endif

/// One square-root accumulator. Private; lives inside the block given to okid_square_root_create(). It holds offsets, no
/// pointers: a memcpy of the block is a snapshot, also for another process of the same library version.
typedef struct okid_square_root okid_square_root_t;

/// What a factor is made for; the words are those of okid_accumulator_config_t.
typedef struct okid_square_root_config_t {
    int32_t n_u;         ///< inputs, >= 0
    int32_t n_y;         ///< outputs, >= 1; n_u + n_y <= 256
    int32_t lags;        ///< p, 1..4096
    int32_t batch;       ///< rows the update takes at once, 1..1024; 0 = 32. Each update rounds R once
    int32_t block;       ///< rows after which a slot closes (window, forgetting); 0 = only at gaps
    int32_t slots;       ///< sliding window of slots * block sample periods (closed slots); 0 = growing. Needs block
    int32_t spare_slots; ///< window only: further slots, because each gap closes one early; full = the window shortens
    double forgetting;   ///< lambda in (0, 1] per sample, applied between blocks; 1 = infinite memory. Needs block
} okid_square_root_config_t;

/// Growing, no window.
static inline okid_square_root_config_t okid_square_root_defaults(int32_t n_u, int32_t n_y, int32_t lags) {
    const okid_square_root_config_t config = {n_u, n_y, lags, 0, 0, 0, 0, 1};
    return config;
}

/// Bytes okid_square_root_create() needs (alignment slack included); 0 when the configuration is invalid or too large for
/// the address space. One triangle of N^2/2 okid_real_t; forgetting 3; window slots + spare_slots + 2.
OKID_API size_t okid_square_root_memsize(const okid_square_root_config_t* config);

/// Lay it out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_square_root_create(okid_square_root_t** self,
                                                              const okid_square_root_config_t* config, void* block,
                                                              size_t bytes);

/// Forget everything; the units stay.
OKID_API void okid_square_root_reset(okid_square_root_t* self);

/// Engineering units of each channel, applied when a result is made: value = scale * sample + offset.
/// @param scale, offset  m numbers each; offset may be NULL (all 0)
OKID_API void okid_square_root_set_units(okid_square_root_t* self, const double* scale, const double* offset);

/// Absorb samples. O(N^2) per sample, no heap, no system call. Calls of all kinds may be mixed.
/// A sample with a channel that is NaN, infinite or of a size whose square would overflow okid_real_t (2^496 in double,
/// 2^48 in float) is missing as a whole: counted, the run ends, the next run re-arms.
/// @param samples  in, column-major m x count; row order: inputs, then outputs
/// @return OKID_OK, OKID_WARN_MISSING, OKID_ERR_NULL
OKID_NODISCARD OKID_API okid_status_t okid_square_root_add(okid_square_root_t* self, const double* samples,
                                                           size_t count);
/// The same for single-precision samples.
OKID_NODISCARD OKID_API okid_status_t okid_square_root_add_f32(okid_square_root_t* self, const float* samples,
                                                               size_t count);

/// The same for ADC codes. @return OKID_OK, OKID_WARN_SATURATED (codes at the full scale of the type), OKID_ERR_NULL
OKID_NODISCARD OKID_API okid_status_t okid_square_root_add_i16(okid_square_root_t* self, const int16_t* codes,
                                                               size_t count);
/// The same for 24-bit or 32-bit codes in int32 words.
OKID_NODISCARD OKID_API okid_status_t okid_square_root_add_i32(okid_square_root_t* self, const int32_t* codes,
                                                               size_t count);

/// Mark `count` missing samples: the run ends here. A gap of 0 samples separates two records.
OKID_API void okid_square_root_gap(okid_square_root_t* self, int64_t count);

/// Stack the factor of `other` under that of `self`, as further records. Both need slots = 0, forgetting = 1, the same n_u,
/// n_y and lags; the references may differ. The open run of `self` ends; `other` keeps its content. Cost 2/3 N^3 flop.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH, OKID_ERR_RANGE (a count beyond OKID_MOST_SAMPLES)
OKID_NODISCARD OKID_API okid_status_t okid_square_root_merge(okid_square_root_t* self, okid_square_root_t* other);

/// Counts since create or reset. @param out  out
OKID_API void okid_square_root_stats(const okid_square_root_t* self, okid_accumulator_stats_t* out);
/// What it was created for. @param out  out
OKID_API void okid_square_root_config(const okid_square_root_t* self, okid_square_root_config_t* out);

/// Regression rows now in the factor (stats.rows, cheaper).
OKID_API int64_t okid_square_root_rows(const okid_square_root_t* self);

/// R^T R in the order and units of okid_accumulator_gram(): rows [v_n; v_(n-1); ..; v_(n-p)].
/// @param gram  out, column-major, m(p+1) x m(p+1), symmetric, both triangles filled
/// @param mean  out, m means of the lag-0 rows in engineering units, may be NULL
/// Cost 2/3 N^3 flop, and as much again for each slot of a window. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_square_root_gram(okid_square_root_t* self, okid_detrend_t detrend,
                                                            double* gram, double* mean);

/// The factor itself in engineering units, for okid_observer_solve_factor().
/// @param factor  out, column-major, n x n with n = m(p+1), upper triangle, diagonal >= 0, zeros below; columns
///                [u_n, v_(n-1), .., v_(n-p), y_n]
/// @param mean    out, m means of the lag-0 rows in engineering units, may be NULL
/// Cost O(N^2), in a window 2/3 N^3 flop for each slot. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_square_root_factor(okid_square_root_t* self, okid_detrend_t detrend,
                                                              okid_real_t* factor, double* mean);

/// okid_identify_run() from the second kernel: nothing is squared, for noise-free or very lightly damped records (condition above 1e10)
/// and as the cross-check. Needs a configuration with the dense solver, and inputs for the okid methods (covariances are
/// squares anyway). @return as okid_identify_run()
OKID_NODISCARD OKID_API okid_status_t okid_identify_run_factor(okid_identify_t* self, okid_square_root_t* square_root,
                                                               okid_identified_t* out);

#ifdef __cplusplus
}
#endif
#endif
