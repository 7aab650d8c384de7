// SPDX-License-Identifier: MIT
/// @file correlation.h
/// Correlations with the past inputs to many lags: all that a maximum-likelihood refinement needs of a record (refine.h).
///
/// For v = [u; y] and the rows t of a run (its samples less the first L) the sums are
///     U_d = sum_t v_t u_(t-d)^T, T_d = sum_t u_(t-L) u_(t-d)^T, d = 0..L,      Y_d = sum_t v_t y_(t-d)^T, d = 0..own_lags,
/// and the L inputs before the first and up to the last row: with them all sums over the lags of filters that end after L lags
/// follow exactly: (m + n_u) n_u (L + 1) numbers, where okid_accumulator_t would take m^2 (L + 1). Cost: twice as many flop a
/// sample directly; by FFT, which 16-bit codes and doubles take where it is faster, some 5 log2(2 L) (m + 2 n_u) + 8 n_u (m + n_u).
/// Measured: 13 channels, 3 of them inputs, L 6,500: 0.5 us a sample (direct 13, codes 135). L should reach as far as the slowest mode rings: ln(1e4)/(zeta omega dt) lags.
///
/// A slot is an unbroken piece of the record; a gap ends it and the next one re-arms with L samples, which give no rows.
/// Growing (block = 0): one set of sums for all, and the ends of up to `slots` runs; what comes after the last slot ended is not
/// summed, but counted (dropped). Window (block > 0): a slot has its own sums and closes after `block` rows; the newest
/// `slots` closed ones and the open one count, each weighted by forgetting^(rows that came after it).
/// Codes are summed exactly (64-bit sums, folded into pairs before they could leave their range), doubles in the order of the
/// samples, or by FFT to rounding: neither the cut of a record into calls nor a look at the sums changes a bit, nor merging of codes.
#ifndef OKID_CORRELATION_H
#define OKID_CORRELATION_H

#include <okid/accumulator.h>

#ifdef __cplusplus
extern "C" {
#endif

/// What the sums are made for: see above.
typedef struct okid_correlation_config_t {
    int32_t n_u;          ///< inputs, >= 1
    int32_t n_y;          ///< outputs, >= 1; n_u + n_y <= 256
    int32_t lags;         ///< L, 1..65536
    int32_t own_lags;     ///< lags of the outputs, 0..min(L, 256)
    okid_sample_t sample; ///< what add() takes
    int32_t block;        ///< rows after which a slot closes; 0 = growing
    int32_t slots;        ///< 1..4096: runs there is room for; with block the closed slots of the window
    int32_t
        saturated_missing; ///< codes: 1 = a sample with a code at full scale is missing as a whole; 0 = taken, counted
    int32_t buffer; ///< samples that wait for the direct kernel, 1 = least memory; 0 = whatever is fastest, FFT or not
    double forgetting; ///< lambda in (0, 1] a row; below 1 needs block
} okid_correlation_config_t;

/// Doubles of one unbroken run.
static inline okid_correlation_config_t okid_correlation_defaults(int32_t n_u, int32_t n_y, int32_t lags) {
    const okid_correlation_config_t config = {n_u, n_y, lags, 0, OKID_SAMPLE_DOUBLE, 0, 1, 0, 0, 1};
    return config;
}

/// Private; lives in the caller's block. It holds offsets, no pointers: a memcpy of the block is a snapshot.
typedef struct okid_correlation okid_correlation_t;

/// Bytes for static arrays: growing sums of codes (doubles take less) without own_lags, with a buffer of 1 or more; never less than okid_correlation_memsize().
#define OKID_CORRELATION_BYTES(n_u, n_y, lags, slots, buffer)                                                          \
    (8 * (2 * ((2 * (size_t)(n_u) + (n_y)) * (n_u) * ((size_t)(lags) + 1) + ((size_t)(n_u) + (n_y)) * (n_y)) +         \
          (size_t)(n_u) * ((lags) + (buffer)) + ((size_t)(n_u) + 2 * (n_y)) * (buffer) + 2 * ((size_t)(n_u) + (n_y)) + \
          (size_t)(slots) * (1 + 2 * (size_t)(n_u) * (lags))) +                                                        \
     320)

/// Bytes okid_correlation_create() needs (alignment slack included); 0 when the configuration is invalid.
OKID_API size_t okid_correlation_memsize(const okid_correlation_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_correlation_create(okid_correlation_t** self,
                                                              const okid_correlation_config_t* config, void* block,
                                                              size_t bytes);
/// Forget everything; the units stay.
OKID_API void okid_correlation_reset(okid_correlation_t* self);
/// Engineering units of each channel, value = scale * code. Offsets: OKID_DETREND_MEAN.
OKID_API void okid_correlation_set_units(okid_correlation_t* self, const double* scale);

/// Absorb samples, column-major m x count, inputs, then outputs. A sample with a NaN or infinite channel is missing as a whole.
/// @return OKID_OK, OKID_WARN_MISSING, OKID_ERR_NULL, OKID_ERR_MISMATCH (created for codes)
OKID_NODISCARD OKID_API okid_status_t okid_correlation_add(okid_correlation_t* self, const double* samples,
                                                           size_t count);
/// The same for 16-bit codes. @return also OKID_WARN_SATURATED
OKID_NODISCARD OKID_API okid_status_t okid_correlation_add_i16(okid_correlation_t* self, const int16_t* codes,
                                                               size_t count);
/// The same for 24-bit or 32-bit codes in int32 words. @return also OKID_ERR_RANGE when a word is no 24-bit code
OKID_NODISCARD OKID_API okid_status_t okid_correlation_add_i32(okid_correlation_t* self, const int32_t* codes,
                                                               size_t count);
/// Mark `count` missing samples: the run ends here. A gap of 0 samples separates two records.
OKID_API void okid_correlation_gap(okid_correlation_t* self, int64_t count);

/// Add all of `other` as further runs (exact for codes). Both are growing, of the same channels, lags and samples. The open run of
/// `self` ends; `other` keeps its content. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH, OKID_ERR_RANGE (more runs than `slots`)
OKID_NODISCARD OKID_API okid_status_t okid_correlation_merge(okid_correlation_t* self, okid_correlation_t* other);

/// Counts since create or reset; rows: of the window, or of all runs. @param out  out
OKID_API void okid_correlation_stats(const okid_correlation_t* self, okid_accumulator_stats_t* out);
/// What it was created for. @param out  out
OKID_API void okid_correlation_config(const okid_correlation_t* self, okid_correlation_config_t* out);

/// The sums in engineering units; the arrays live in the block given to okid_correlation_sums(). All column-major.
typedef struct okid_correlation_sums_t {
    int32_t n_u;           ///< as in the config
    int32_t n_y;           ///< as in the config
    int32_t lags;          ///< as in the config
    int32_t own_lags;      ///< as in the config
    int32_t runs;          ///< pieces whose ends are given: runs, or slots that fade
    int32_t centred;       ///< 1: samples are less their means; what the rounding of the means leaves stands in `sum`
    double rows;           ///< weight of all rows
    const double* U;       ///< m x n_u (lags + 1): column d n_u + c is sum v_t u_c(t-d)
    const double* Y;       ///< m x n_y (own_lags + 1): column d n_y + c is sum v_t y_c(t-d)
    const double* T;       ///< n_u x n_u (lags + 1): column d n_u + c is sum u_(t-lags) u_c(t-d)
    const double* sum;     ///< m: of v_t
    const double* lag_sum; ///< n_u x (lags + 1): of u_(t-d)
    const double*
        ends; ///< for each piece head, then tail: n_u x lags, column a is u_(f-1-a) before the first row f, and
              ///< u_(l-a) up to the last row l
    const double* weight; ///< of each piece
} okid_correlation_sums_t;

/// Bytes okid_correlation_sums() needs now.
OKID_API size_t okid_correlation_sums_memsize(const okid_correlation_t* self);
/// @param detrend  OKID_DETREND_MEAN: every channel less its mean over the rows (codes: less the nearest code, exactly)
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_correlation_sums(okid_correlation_t* self, okid_detrend_t detrend,
                                                            okid_correlation_sums_t* out, void* block, size_t bytes);

/// The whole state as bytes, the same on every processor and in every build. Little endian: 8 bytes "OKIDCOR\n"; int32 format
/// (1), n_u, n_y, lags, own_lags, sample, block, slots, saturated_missing; double forgetting; the six counts of
/// okid_accumulator_stats_t; int64 clock; int32 samples at hand, in a gap, closed slots; scale; the lag window (inputs, then outputs);
/// each slot, oldest first (rows, head, tail: inputs, then outputs); each set of sums (low words, high
/// words, sums of the channels; doubles: plain). At the end the CRC-32 of all before it.
OKID_API size_t okid_correlation_serialised_size(okid_correlation_t* self);
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_correlation_serialise(okid_correlation_t* self, void* out, size_t bytes);
/// What it was created with (buffer: 0), to create one that fits. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_FORMAT
OKID_NODISCARD OKID_API okid_status_t okid_correlation_peek(const void* in, size_t bytes,
                                                            okid_correlation_config_t* out);
/// Put the state back and go on where it stopped, bit for bit. On error the state is unchanged.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_FORMAT, OKID_ERR_MISMATCH (created otherwise)
OKID_NODISCARD OKID_API okid_status_t okid_correlation_deserialise(okid_correlation_t* self, const void* in,
                                                                   size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
