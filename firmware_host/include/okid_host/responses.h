/* SPDX-License-Identifier: MIT */
/**
 * @file responses.h
 * @brief Measured frequency responses to a result, as of records.
 */
#ifndef OKID_HOST_RESPONSES_H
#define OKID_HOST_RESPONSES_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

struct okid_host_result; /* okid_host/record.h */

/**
 * Identify from frequency responses; what `okid identify --frf` does with its files.
 *
 * @param options   JSON object: inputs and outputs (lists of names, needed), sensing, input_dofs, output_dofs, band, modes,
 *                  stabilization, all_modes, exponential (s), set_ups (how many the responses come from); null = as if not given
 * @param lines     frequencies
 * @param frequency_hz  ascending
 * @param response  (re, im) of output o to input i at line l from response[2 * ((l * inputs + i) * outputs + o)] on; read
 *                  during the call only
 * @return 0 and the result, or 2, 3, 4; then `*result` is NULL
 */
OKID_HOST_API int32_t okid_host_identify_responses(const char* options, size_t lines, const double* frequency_hz,
                                                   const double* response, struct okid_host_result** result);

/** Responses of files. */
typedef struct okid_host_responses okid_host_responses_t;

/**
 * Read frequency responses from universal files (data sets 58, 58b) or CSV; several files are set-ups of one structure.
 * @return 0, or 2: okid_host_error() names the file, what was found and what was expected
 */
OKID_HOST_API int32_t okid_host_responses_read(const char* const* paths, int32_t count, okid_host_responses_t** out);

/** {"inputs": [..], "outputs": [..], "set_ups": n}. */
OKID_HOST_API const char* okid_host_responses_json(const okid_host_responses_t* self);

/** The frequencies and the numbers as okid_host_identify_responses() takes them. @return lines */
OKID_HOST_API size_t okid_host_responses_data(const okid_host_responses_t* self, const double** frequency_hz,
                                              const double** response);

OKID_HOST_API void okid_host_responses_delete(okid_host_responses_t* self);

#ifdef __cplusplus
}
#endif

#endif
