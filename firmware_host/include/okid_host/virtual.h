/* SPDX-License-Identifier: MIT */
/**
 * @file virtual.h
 * @brief Virtual sensors: what outputs that are not measured show, and which forces act, with standard deviations.
 */
#ifndef OKID_HOST_VIRTUAL_H
#define OKID_HOST_VIRTUAL_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A Kalman filter of an identified model, as `okid run` has it with [virtual]. */
typedef struct okid_host_virtual okid_host_virtual_t;

/**
 * Make one out of JSON of schema okid.virtual/1: `model` with A, B, C, D, K (lists of rows) and dt (s), `noise` (covariance
 * of the innovations); optional `inputs`, `outputs` (names), `mean` (of [u; y]), `widen`, `input_std`, `force_std` (the
 * inputs are not measured but estimated), `force_hz`.
 * @return 0, or 2: okid_host_error() names the key, what was found and what was expected
 */
OKID_HOST_API int32_t okid_host_virtual_create(const char* json, okid_host_virtual_t** out);

/** Another one that stands where this one does. @return 0, or 4: out of memory */
OKID_HOST_API int32_t okid_host_virtual_copy(const okid_host_virtual_t* self, okid_host_virtual_t** out);

/**
 * Take means, noise and how far to trust the deviations from a record; what comes next begins at rest.
 * @param rows  count rows [u; y] with all inputs of the model, NaN = missing
 * @return 0, or 2 with nothing changed: too few complete samples
 */
OKID_HOST_API int32_t okid_host_virtual_learn(okid_host_virtual_t* self, size_t count, const double* rows);

/**
 * Samples in, from where the filter stands.
 * @param rows   count rows [u; y], NaN = missing; without the inputs where these are estimated
 * @param y      out, count rows of the outputs: measured where they are there, else estimated
 * @param y_std  out, one standard deviation each, 0 where measured
 * @param force, force_std  out, count rows of the inputs where they are estimated; else not touched
 * @return 0, or 2: an input is missing whose strength was never learnt; the rows before it are taken in
 */
OKID_HOST_API int32_t okid_host_virtual_run(okid_host_virtual_t* self, size_t count, const double* rows, double* y,
                                            double* y_std, double* force, double* force_std);

/** Forget the state: what comes next begins at rest. */
OKID_HOST_API void okid_host_virtual_reset(okid_host_virtual_t* self);

/** As okid_host_virtual_create() takes it, with what was learnt. */
OKID_HOST_API const char* okid_host_virtual_json(okid_host_virtual_t* self);

OKID_HOST_API void okid_host_virtual_delete(okid_host_virtual_t* self);

#ifdef __cplusplus
}
#endif

#endif
