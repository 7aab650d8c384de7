/* SPDX-License-Identifier: MIT */
/**
 * @file stream.h
 * @brief Samples as they arrive to modes and results: the recursive identification of `okid run`, fed by the caller.
 *
 * Of a named method memory is taken when a stream is made; okid_host_stream_add() takes none. It costs O(m q) a sample, twice
 * that with standard deviations and without a window. Method auto (the default, unless an option of one method is given)
 * keeps the samples of the window, or the newest 10 million numbers; an update identifies from them. A named method with
 * refine keeps correlation sums beside its own: some 2 (m + n_u) n_u L flop a sample, L lags to where the slowest mode has
 * decayed, at most 8192; the first 8,192 samples (65,536 where they give no model) are kept until L is chosen.
 */
#ifndef OKID_HOST_STREAM_H
#define OKID_HOST_STREAM_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct okid_host_stream okid_host_stream_t;
struct okid_host_config; /* okid_host/files.h */
struct okid_host_result; /* okid_host/record.h */

/**
 * Make a stream.
 * @param options  JSON object: inputs, outputs (lists of names), fs (Hz), method, p, rows, order, max_order, hankel, hold,
 *                 band, decimate, detrend (none or mean), sigma, sigma_blocks, refine, sensing, input_dofs, output_dofs as for
 *                 okid_host_identify();
 *                 window_s, window, forgetting, update_s, restart_on_change as in [identification] of a CONFIG.toml; codes (0 real
 *                 numbers, or the bits of ADC codes: 16, 24, 32), scale and offset (one number, or one a channel: value =
 *                 scale * sample + offset), saturated (keep, missing: samples with a code at full scale); states_only
 *                 (true: nothing is added but states, so no memory for further blocks is needed). null = as if not given
 * @param config   NULL; or what stands for the options that are not given. Samples are then in the SI units of its channels
 * @return 0 and the stream; else 2, and `*out` is NULL
 */
OKID_HOST_API int32_t okid_host_stream_create(const char* options, const struct okid_host_config* config,
                                              okid_host_stream_t** out);

/** The options in force as JSON, with those that were not given. */
OKID_HOST_API const char* okid_host_stream_json(const okid_host_stream_t* self);

/** What samples are. Real numbers go to a stream with codes = 0, codes to one with codes of their size. */
typedef enum okid_host_sample {
    OKID_HOST_DOUBLE = 0,
    OKID_HOST_FLOAT = 1,
    OKID_HOST_INT16 = 2,
    OKID_HOST_INT32 = 3
} okid_host_sample_t;

/**
 * Take in `count` rows [u; y]; a real number that is NaN or infinite makes its row missing.
 * @return 0, the warning of the library (OKID_WARN_...: samples missing, codes saturated) as a number > 0, or minus the exit
 *         code (-2 another type of samples or a word that is no code, -3 sums that are full, -4)
 */
OKID_HOST_API int32_t okid_host_stream_add(okid_host_stream_t* self, int32_t kind, const void* rows, size_t count);

/** `count` samples are missing here; 0 = another record begins. */
OKID_HOST_API int32_t okid_host_stream_gap(okid_host_stream_t* self, int64_t count);

/** Forget all samples. */
OKID_HOST_API void okid_host_stream_reset(okid_host_stream_t* self);

/** Counts since the start. */
typedef struct okid_host_stream_counts {
    int64_t samples;   /**< absorbed; missing ones not counted */
    int64_t missing;   /**< samples missing */
    int64_t gaps;      /**< runs of missing samples */
    int64_t saturated; /**< codes at full scale */
    int64_t rows;      /**< equations that are remembered now */
    int64_t dropped;   /**< always 0 */
    int64_t restarts;  /**< changes of the structure after which what was before was forgotten */
    int64_t bytes;     /**< of the sums of the whole */
    int64_t unknowns;  /**< of the regression; modes are shown from twice as many equations on */
    int64_t settled;   /**< 1: the modal table of the last update has settled */
} okid_host_stream_counts_t;
OKID_HOST_API int32_t okid_host_stream_stats(okid_host_stream_t* self, okid_host_stream_counts_t* out);

/**
 * An update, as `okid run` makes one each update_s: the modes by now with their standard deviations. A model that has
 * settled is watched from then on: a change of the structure is noticed with the next update, and a window or a fading
 * memory has then forgotten what was before (restart_on_change).
 * @return 0 and the result, NULL while no model is possible; or 2, 3, 4
 */
OKID_HOST_API int32_t okid_host_stream_update(okid_host_stream_t* self, struct okid_host_result** result);

/** Everything the samples tell by now. The decomposition of the result is the stream's: it is gone with the next update or
 * result of the stream. @return 0; 3: no model; 4 */
OKID_HOST_API int32_t okid_host_stream_identify(okid_host_stream_t* self, struct okid_host_result** result);

/** The sums as bytes, for a file or another machine: a head ("OKIDSTR\n", uint64 bytes of the head, uint32 CRC-32 of all other bytes, JSON with rate_hz,
 * inputs, outputs), then the sums (format: okid/accumulator.h; of method auto the samples; with refine the correlation sums before
 * them, as bytes of their own: "OKIDREF\n", uint64 their number); the bytes are the stream's until its next call. Sums without a head, of 0.1 or of an
 * accumulator, are read too. @return 0 or 4 */
OKID_HOST_API int32_t okid_host_stream_state(okid_host_stream_t* self, const void** state, size_t* bytes);

/** Go on where a state of the same rate, channels, lags and memory stood. With refine its correlation sums bring their lags and
 * the filter of the noise along, which stay with a reset: what comes after that can be merged with the state. What was before is one block for standard deviations, in
 * a fading memory none. @return 0 or 2; on an error nothing is changed */
OKID_HOST_API int32_t okid_host_stream_restore(okid_host_stream_t* self, const void* state, size_t bytes);

/** Add all samples of a state as further records, and as one block for standard deviations. For a growing memory; with
 * refine of streams that have lags and filter of one state in common.
 * @return 0 or 2; on an error nothing is changed */
OKID_HOST_API int32_t okid_host_stream_merge(okid_host_stream_t* self, const void* state, size_t bytes);

OKID_HOST_API void okid_host_stream_delete(okid_host_stream_t* self);

#ifdef __cplusplus
}
#endif

#endif
