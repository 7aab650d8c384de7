// SPDX-License-Identifier: MIT
/// @file accumulator.h
/// The only thing that runs per sample: the shift-structured Gram matrix of lagged samples.
///
/// For a run of consecutive samples the sums S_b = sum_n v_n v_(n-b)^T, b = 0..p, and the p samples at each end of the run
/// determine the whole Gram matrix of [v_n; v_(n-1); ..; v_(n-p)] (paper eq. 36-38 without the zeros of eq. 38, which
/// would be wrong for a structure that already moves). Cost: 2 m^2 (p+1) flop a sample, whatever q is.
///
/// Samples stand in *slots*: a slot is an unbroken piece of the record (at most `block` samples where a window or
/// forgetting is asked for). A gap closes a slot. Closed slots either stay in a ring (window, `slots` > 0) and fall out
/// of it whole, or are folded into the base sums, which need the edge Gram of q^2/2 numbers (`edges` = 1).
/// Samples wait in a small buffer (`buffer`) until the kernel can take many at once. Sums grow in the order of the samples:
/// neither the cut of a record into calls nor the buffer changes anything, not even the last bit of double sums.
///
/// Codes are summed exactly: any split of a record into calls, any order of merging gives bit-equal results. The bounds,
/// with b bits a code and products of at most 2^(2b-2) in magnitude:
///   int16: the kernel sums at most 2^22 rows in double (2^30 2^22 = 2^52 < 2^53, exact);
///   int24: at most 2^7 rows (2^46 2^7 = 2^53, exact);
///   int32: codes are split into high 16 and low 16 bits; three double sums of at most 2^20 rows (2^33 2^20 = 2^53);
/// then the doubles are added to pairs of 64-bit integers, value = high 2^48 + low with 0 <= low < 2^48, whose range of
/// 2^111 holds full-scale 32-bit products (2^62) for 2^49 rows. Sums of the codes themselves are 64-bit integers:
/// 2^31 2^32 = 2^63; OKID_ERR_RANGE stands before 2^32 rows of int32 codes (2^40 of int24, 2^48 of int16) are reached.
/// With `bulk` = 1 calls of more than some hundred int16 samples (or doubles: see below) go through an FFT (windows whose ends the
/// direct kernel adds, cross-spectra added, the inverse transform rounded to integers): a third to a tenth of the work at 20 to 80 lags,
/// and the same integers, because a batch is only taken while the proven error of its sums stays below 1/2. Sums of doubles are then right
/// to some 100 eps of the energy of their channels, as plain sums of many samples are; how calls are cut changes last bits.
#ifndef OKID_ACCUMULATOR_H
#define OKID_ACCUMULATOR_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// What the samples are.
typedef enum okid_sample_t {
    OKID_SAMPLE_DOUBLE = 0, ///< double samples, double sums
    OKID_SAMPLE_INT16 = 1,  ///< int16 ADC codes, exact integer sums
    OKID_SAMPLE_INT24 = 2,  ///< int32 words that hold 24-bit codes, exact integer sums
    OKID_SAMPLE_INT32 = 3   ///< int32 ADC codes, exact integer sums
} okid_sample_t;

/// One recursive accumulator. Private; lives inside the block given to okid_accumulator_create(). It holds offsets, no
/// pointers: a memcpy of the block is a snapshot, also for another process of the same library version.
typedef struct okid_accumulator okid_accumulator_t;

/// What an accumulator is made for: see above.
typedef struct okid_accumulator_config_t {
    int32_t n_u;          ///< inputs, >= 0
    int32_t n_y;          ///< outputs, >= 1; n_u + n_y <= 256
    int32_t lags;         ///< p, 1..4096
    okid_sample_t sample; ///< what add() takes
    int32_t block;        ///< rows after which a slot closes; 0 = only at gaps
    int32_t slots;        ///< sliding window of slots * block sample periods (closed slots); 0 = growing. Needs block
    double forgetting; ///< lambda in (0, 1] per sample, applied between blocks; 1 = infinite memory. Needs block, edges
    int32_t edges;     ///< 1 = room for the edge Gram: gaps, several records, merge, forgetting; 0 = one unbroken run
    int32_t spare_slots; ///< window only: further slots, because each gap closes one early; full = the window shortens
    int32_t bulk;        ///< int16, double: 1 = FFT path for long calls, where it pays (less work, more memory)
    int32_t
        saturated_missing; ///< codes: 1 = a sample with a code at full scale is missing as a whole; 0 = taken, counted
    int32_t
        buffer; ///< samples that wait for the kernel; 0 = 256, 1 = none: least memory, for processors that have little
} okid_accumulator_config_t;

/// Doubles of one unbroken run: growing, no window, no edges.
static inline okid_accumulator_config_t okid_accumulator_defaults(int32_t n_u, int32_t n_y, int32_t lags) {
    const okid_accumulator_config_t config = {n_u, n_y, lags, OKID_SAMPLE_DOUBLE, 0, 0, 1, 0, 0, 0, 0, 0};
    return config;
}

/// Counts since create or reset.
typedef struct okid_accumulator_stats_t {
    int64_t samples;   ///< samples absorbed, missing ones not counted
    int64_t missing;   ///< samples missing (NaN, infinite, or given by okid_accumulator_gap)
    int64_t gaps;      ///< runs of missing samples that broke a run
    int64_t saturated; ///< codes at full scale
    int64_t rows;      ///< regression rows now in the sums (window: of the window); each run gives its samples less p
    int64_t dropped;   ///< rows lost because edges = 0 and a second run began (the older run was dropped)
} okid_accumulator_stats_t;

/// Bytes of an accumulator of double samples for one unbroken run without a buffer (edges 0, slots 0, buffer 1): a constant
/// for static arrays, never less than okid_accumulator_memsize(). Beside S (m^2 (p+1) numbers), the head and the lag window
/// (p m each) it holds 4 m numbers and counters: at most 1.1 times 8 [m (q + n_y) + 2 p m] bytes for m >= 4, p >= 20.
#define OKID_ACCUMULATOR_BYTES(n_u, n_y, p)                                                                            \
    (8 * (((size_t)(n_u) + (n_y)) * ((size_t)(n_u) + (n_y)) * ((size_t)(p) + 1) + 2 * (size_t)(p) * ((n_u) + (n_y)) +  \
          4 * ((size_t)(n_u) + (n_y))) +                                                                               \
     320)

/// Planes of 64-bit words beside the first: one more where the kernel sums in double.
#ifdef OKID_INTEGER_KERNEL
#define OKID_ACCUMULATOR_PLANES 1
#else
#define OKID_ACCUMULATOR_PLANES 2
#endif
/// OKID_ACCUMULATOR_BYTES() for 16 or 24-bit codes, whose sums take two planes of 64-bit words, and one more where the kernel
/// sums in double.
#define OKID_ACCUMULATOR_CODES_BYTES(n_u, n_y, p)                                                                      \
    (OKID_ACCUMULATOR_BYTES(n_u, n_y, p) +                                                                             \
     8 * OKID_ACCUMULATOR_PLANES * ((size_t)(n_u) + (n_y)) * ((size_t)(n_u) + (n_y)) * ((size_t)(p) + 1))

/// Bytes okid_accumulator_create() needs (alignment slack included); 0 when the configuration is invalid.
OKID_API size_t okid_accumulator_memsize(const okid_accumulator_config_t* config);

/// Lay an accumulator out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_create(okid_accumulator_t** self,
                                                              const okid_accumulator_config_t* config, void* block,
                                                              size_t bytes);

/// Become what `from` is, units and all; both were created with the same configuration. @return OKID_OK, OKID_ERR_NULL,
/// OKID_ERR_MISMATCH
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_copy(okid_accumulator_t* self, const okid_accumulator_t* from);

/// Forget everything; the units stay.
OKID_API void okid_accumulator_reset(okid_accumulator_t* self);

/// Engineering units of each channel, applied when the Gram matrix is made: value = scale * code + offset.
/// @param scale, offset  m numbers each; offset may be NULL (all 0)
OKID_API void okid_accumulator_set_units(okid_accumulator_t* self, const double* scale, const double* offset);

/// Absorb a block of samples. O(m^2 (p+1)) per sample, no heap, no system call. On error the state is unchanged.
/// A sample with a NaN or infinite channel is missing as a whole: counted, the run ends, the next run re-arms.
/// @param samples  in, column-major m x count; row order: inputs, then outputs
/// @return OKID_OK, OKID_WARN_MISSING, OKID_ERR_NULL, OKID_ERR_MISMATCH (created for codes)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_add(okid_accumulator_t* self, const double* samples,
                                                           size_t count);

/// The same for single-precision samples; the sums are double.
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_add_f32(okid_accumulator_t* self, const float* samples,
                                                               size_t count);

/// The same for 16-bit codes, summed exactly. @return also OKID_WARN_SATURATED, OKID_ERR_RANGE
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_add_i16(okid_accumulator_t* self, const int16_t* codes,
                                                               size_t count);

/// The same for 24-bit or 32-bit codes in int32 words, as the accumulator was created for.
/// @return also OKID_ERR_RANGE when a word is no 24-bit code (nothing is absorbed then)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_add_i32(okid_accumulator_t* self, const int32_t* codes,
                                                               size_t count);

/// Samples that an accumulator counts at most, missing ones included: 292 years at 0.5 GHz.
#define OKID_MOST_SAMPLES (INT64_C(1) << 62)

/// Mark `count` missing samples: the run ends here. A gap of 0 samples separates two records; a negative one is none, and
/// one beyond OKID_MOST_SAMPLES in all ends there.
OKID_API void okid_accumulator_gap(okid_accumulator_t* self, int64_t count);

/// Add all of `other` to `self` as further records (exact for codes). Both need edges = 1, slots = 0, the same n_u, n_y
/// and sample type; of an `other` with more lags the first ones are taken. The open run of `self` ends; `other` keeps its content. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (also: one of them
/// centred, the other not), OKID_ERR_RANGE (rows whose sums would leave their words, or more than OKID_MOST_SAMPLES)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_merge(okid_accumulator_t* self, okid_accumulator_t* other);

/// Take `part` out of `self` again: the inverse of okid_accumulator_merge(), to the last bit for codes. What is left is the
/// record without that part, as if a gap stood there. A part of an unbroken record is an accumulator that was fed with its own
/// samples and, before them, the p = lags samples in front: then its rows are those of its own samples, and the parts add
/// up to the whole. The open run of `self` ends. Both need edges = 1, slots = 0 and the same forgetting; with forgetting
/// the part must begin and end where slots of `self` do.
/// @param weight  1; with forgetting lambda^(rows of `self` in slots closed since the part ended), 0 < weight <= 1
/// Cost O((m p)^2). @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (also: it has fewer rows than the part),
/// OKID_ERR_RANGE (weight)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_remove(okid_accumulator_t* self, okid_accumulator_t* part,
                                                              double weight);

/// Slots that hold the rows now, the open one included and last; without a window 1.
OKID_API int32_t okid_accumulator_slots(const okid_accumulator_t* self);
/// Regression rows in slot k, 0 = the oldest; 0 for a slot that does not exist.
OKID_API int64_t okid_accumulator_slot_rows(const okid_accumulator_t* self, int32_t k);

/// Add slots first .. first + count - 1 of a window to `self`: a part of the window, or all of it as a record that parts can
/// be removed from. `from` keeps its content; the open run of `self` ends. `self` needs edges = 1, slots = 0, forgetting = 1 and
/// the n_u, n_y and sample type of `from`, and no more lags; neither may be centred. Cost O((m p)^2) an unbroken run of slots.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH, OKID_ERR_DIM (slots that do not exist)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_take_slots(okid_accumulator_t* self, okid_accumulator_t* from,
                                                                  int32_t first, int32_t count);

/// Forget the oldest closed slots of a window. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (slots that do not exist)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_drop_slots(okid_accumulator_t* self, int32_t count);

/// Make one closed slot of each two that follow each other without a gap, and the block twice as long: a window of as many slots
/// then spans twice the time. No row is lost. Cost O(m^2 p) a slot.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (no window), OKID_ERR_RANGE (the block is 2^30 rows long)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_pair_slots(okid_accumulator_t* self);

/// What `from` would hold had the other channels never been measured, to the last bit: for a sensor that proves to be broken when
/// the samples are gone. What `self` held is dropped; `from` keeps its content. Samples that were missing for the sake of
/// another channel stay so.
/// @param channels  one for each channel of `self`, its number in `from`: rising, inputs from inputs and outputs from outputs
/// `self` is like `from` in lags, sample type, slots, spare slots, edges and whether it forgets. Cost O((m p)^2) of `self`.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH, OKID_ERR_DIM (channels)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_take_channels(okid_accumulator_t* self, okid_accumulator_t* from,
                                                                     const int32_t* channels);

/// Take the offsets out of a finished record before it is merged: every channel less its mean over the record, so that
/// offsets that moved between records do no harm. Codes: less the mean rounded to 2^-8 code, exactly, so that any order of
/// merging still gives the same bits. The run ends; no samples are taken any more (OKID_ERR_MISMATCH), only merges with others
/// that are centred too (an empty accumulator takes either kind). Offsets given to set_units() no longer count.
/// Needs edges = 1, slots = 0, forgetting = 1. Cost O((m p)^2). @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH, OKID_ERR_RANGE
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_centre(okid_accumulator_t* self);

/// Counts since create or reset. @param out  out
OKID_API void okid_accumulator_stats(const okid_accumulator_t* self, okid_accumulator_stats_t* out);
/// What it was created for. @param out  out
OKID_API void okid_accumulator_config(const okid_accumulator_t* self, okid_accumulator_config_t* out);

/// Regression rows now in the sums (stats.rows, cheaper).
OKID_API int64_t okid_accumulator_rows(const okid_accumulator_t* self);

/// The Gram matrix of the lagged samples w_n = [v_n; v_(n-1); ..; v_(n-p)] over all rows, in engineering units.
/// @param detrend  OKID_DETREND_MEAN centres every lag row by its own mean
/// @param gram     out, column-major, m(p+1) x m(p+1), symmetric, both triangles filled
/// @param mean     out, m means of the lag-0 rows in engineering units, may be NULL
/// Cost O((m p)^2 (1 + slots)). @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_gram(okid_accumulator_t* self, okid_detrend_t detrend,
                                                            double* gram, double* mean);

/// The first m entries of the Gram matrix's diagonal: sum of squares of each channel over the rows. O(m slots) flop.
/// @param energy  out, m numbers. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_energy(okid_accumulator_t* self, okid_detrend_t detrend,
                                                              double* energy);

/// The sums of one unbroken run: all that okid_structured_solve() needs, O(m q) numbers. The arrays are the caller's.
typedef struct okid_run_sums_t {
    double* S;    ///< m x m(p+1) column-major: S_0 .. S_p side by side, S_b(r, c) = sum of v_n[r] v_(n-b)[c]
    double* head; ///< m x p: column a is v_(f-1-a), f the first regression row
    double* tail; ///< m x p: column a is v_(l-a), l the last regression row
    double* sum;  ///< m: sum of v_n over the rows
    double* mean; ///< m means of the lag-0 rows, or NULL
    int64_t rows; ///< regression rows behind the sums
} okid_run_sums_t;

/// The sums of the one run there is, in engineering units.
/// With OKID_DETREND_MEAN the samples are taken less a constant near their mean (codes: the nearest whole code), which `sum`
/// accounts for: removing the means with it is then harmless to the digits.
/// @param sums  in: the arrays; out: what they hold, and rows
/// Cost O(m^2 p slots). @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT (no rows), OKID_ERR_MISMATCH (more than one run)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_run(okid_accumulator_t* self, okid_detrend_t detrend,
                                                           okid_run_sums_t* sums);

/// The whole state as bytes for a file, another machine or a later version; the same on every processor and in every build.
/// Little endian: 8 bytes "OKIDACC\n"; int32 format (1), n_u, n_y, lags, sample, block, slots, edges, spare_slots,
/// saturated_missing; double forgetting; the six counts of okid_accumulator_stats_t; int64 clock; double weight of the base;
/// int32 samples of the lag window at hand, in a gap, centred, closed slots; scale and offset; the samples of the lag window in time order;
/// each slot, oldest first (rows, clock at its start, joined; S: codes low words, then high words, value = high 2^48 + low;
/// sum; head; tail with a window only); the base with edges and no window (S, sum, edge sums, edge Gram). Samples are doubles,
/// codes int32. At the end the CRC-32 of all before it.
OKID_API size_t okid_accumulator_serialised_size(okid_accumulator_t* self);
/// @param bytes  room at `out`, at least okid_accumulator_serialised_size(). @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_serialise(okid_accumulator_t* self, void* out, size_t bytes);
/// What the accumulator was created with (buffer and bulk are the reader's own business: 0), to create one that fits.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_FORMAT (magic, version, length or CRC)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_peek(const void* in, size_t bytes,
                                                            okid_accumulator_config_t* out);
/// Put the state back and go on where it stopped, bit for bit. On error the state is unchanged.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_FORMAT, OKID_ERR_MISMATCH (created otherwise)
OKID_NODISCARD OKID_API okid_status_t okid_accumulator_deserialise(okid_accumulator_t* self, const void* in,
                                                                   size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
