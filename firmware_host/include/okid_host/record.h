/* SPDX-License-Identifier: MIT */
/**
 * @file record.h
 * @brief Measured records in memory to a result: modes, model, M, K and R, standard deviations, warnings.
 */
#ifndef OKID_HOST_RECORD_H
#define OKID_HOST_RECORD_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A result, of a record or of a stream. It holds all its numbers itself. */
typedef struct okid_host_result okid_host_result_t;

/** Called with the name of each stage that begins, in the thread of the call. */
typedef void (*okid_host_stage_t)(void* context, const char* stage);

/**
 * Identify records of one structure, merged exactly; what `okid identify` does with its files.
 *
 * @param options  JSON object with the options of `okid identify` from inputs to sigma_blocks (docs, "okid identify") by their
 *                 long names, `-` written `_`: inputs and outputs as lists of channel names, outputs at least one; fs (Hz)
 *                 is needed. null = as if not given. units: one a channel, for M, K, R; without it they are taken from the
 *                 names ("acc1 [g]", "acc1_g").
 * @param records  how many
 * @param samples  of each: counts[i] rows [u; y], NaN = missing; read during the call only
 * @param names    of each, for messages
 * @param stage    may be NULL
 * @return 0 and the result, or 2, 3, 4; then `*result` is NULL
 */
OKID_HOST_API int32_t okid_host_identify(const char* options, int32_t records, const double* const* samples,
                                         const size_t* counts, const char* const* names, okid_host_stage_t stage,
                                         void* context, okid_host_result_t** result);

/** Channels of a record as arrays have them: sample n of channel c stands at data + n * row_stride + c * channel_stride. */
typedef struct okid_host_columns {
    const void* data;
    int32_t type;                         /**< of a number: 0 double, 1 float, 2 int16, 3 int32 */
    size_t channels;                      /**< 0: none, data may be NULL */
    ptrdiff_t row_stride, channel_stride; /**< in bytes */
} okid_host_columns_t;

/**
 * okid_host_identify() of records whose inputs and outputs stand apart, in numbers of any of four types.
 *
 * @param inputs, outputs  of each record, counts[i] samples; read during the call only. A number that is infinite is refused
 */
OKID_HOST_API int32_t okid_host_identify_columns(const char* options, int32_t records,
                                                 const okid_host_columns_t* inputs, const okid_host_columns_t* outputs,
                                                 const size_t* counts, const char* const* names,
                                                 okid_host_stage_t stage, void* context, okid_host_result_t** result);

/**
 * Identify several set-ups of one structure; what `okid identify --setups` does with its files.
 *
 * @param options  as for okid_host_identify(): fs, inputs, outputs (of every set-up in turn: as many names as it has columns;
 *                 the same name is the same sensor), method, band, detrend, sigma, input_dofs, output_dofs, modes (method
 *                 plscf); references: names of outputs that every set-up has
 */
OKID_HOST_API int32_t okid_host_identify_set_ups(const char* options, int32_t count, const okid_host_columns_t* inputs,
                                                 const okid_host_columns_t* outputs, const size_t* counts,
                                                 const char* const* names, okid_host_result_t** result);

/** okid.result/1, as `okid identify --json` writes it. NULL when memory ran out. */
OKID_HOST_API const char* okid_host_result_json(okid_host_result_t* self);

/** The same without singular_values, model and markov, which are there as arrays. */
OKID_HOST_API const char* okid_host_result_summary(okid_host_result_t* self);

/** The same without fit and warnings too: the fits of a named method may be computed only when they are first asked for. */
OKID_HOST_API const char* okid_host_result_brief(okid_host_result_t* self);

/** The modal table, fits, matrices and warnings for a person, as `okid identify` prints them. */
OKID_HOST_API const char* okid_host_result_table(okid_host_result_t* self);

/** Numbers of a result. The element [i][j][k] is data[i * stride[0] + j * stride[1] + k * stride[2]]. */
typedef struct okid_host_array {
    const double* data; /**< NULL where any size is 0 */
    int32_t rank;       /**< 1 to 3 */
    size_t size[3];     /**< 1 beyond the rank */
    size_t stride[3];   /**< in numbers */
} okid_host_array_t;

/**
 * An array of the result by the place it has in okid.result/1: "model.A" .. "model.K", "model.x0" (records, states),
 * "singular_values", "markov.Y", "modes.frequency_hz" .. "modes.shape_im" (modes, outputs), "fit.simulation_percent",
 * "fit.prediction_percent", "mkr.M" .. "mkr.R_normal_modes_std", "pdc.R"; and "observer": ridge, spectral radius, that of
 * plain least squares, condition, excitation (okid_observer_info_t).
 * @return 1 and the array; 0: the result has none of this name
 */
OKID_HOST_API int32_t okid_host_result_array(okid_host_result_t* self, const char* name, okid_host_array_t* out);

/** Of a result of records: an okid_identify_t with its okid_identify_config_t, and the okid_identified_t it gave. */
typedef struct okid_host_decomposition {
    void* identifier; /**< for okid_identify_order() and okid_identify_poles(), which do not change the result */
    const void* config;
    const void* model;
} okid_host_decomposition_t;

/** The decomposition the result came from, for models of other orders. @return 1; 0: the result has none */
OKID_HOST_API int32_t okid_host_result_decomposition(okid_host_result_t* self, okid_host_decomposition_t* out);

OKID_HOST_API void okid_host_result_delete(okid_host_result_t* self);

#ifdef __cplusplus
}
#endif

#endif
