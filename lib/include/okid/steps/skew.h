// SPDX-License-Identifier: MIT
/// @file steps/skew.h
/// How late each sensor comes against the forces, from the phases of the modes of an identified model, and the model
/// without these delays. A hundredth of a sample ruins R (docs/numerics.md, trap 15), and no fit of the outputs shows it.
///
/// Of a structure whose points move in phase (real modes) every residue c b stands at a known angle; a sensor that is tau
/// late turns mode k by -w_k tau. One delay for each output is fitted to the angles of all modes. What no delay explains
/// are complex modes, a wrong hold or a wrong kind of sensor: then the delays are undetermined, and nothing is corrected.
#ifndef OKID_STEPS_SKEW_H
#define OKID_STEPS_SKEW_H

#include <okid/mkr.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sums over a model and its replicates. Private; lives in the caller's block.
typedef struct okid_skew okid_skew_t;

/// Sizes of the models, and where the channels stand.
typedef struct okid_skew_config_t {
    int32_t n_u;                  ///< inputs of the models, >= 1
    int32_t n_y;                  ///< outputs, >= 1
    int32_t n_z;                  ///< states, >= 1
    int32_t replicates;           ///< room for so many, 2..64
    const okid_mkr_config_t* mkr; ///< where the channels stand; used until the last call, not copied
} okid_skew_config_t;

/// Room for 20 replicates.
static inline okid_skew_config_t okid_skew_defaults(int32_t n_u, int32_t n_y, int32_t n_z,
                                                    const okid_mkr_config_t* mkr) {
    const okid_skew_config_t config = {n_u, n_y, n_z, 20, mkr};
    return config;
}

/// The delays; the arrays live in the object.
typedef struct okid_skew_result_t {
    int32_t n_y;              ///< outputs
    int32_t undetermined;     ///< 1: the angles scatter more than their deviations explain (scatter > 3)
    int32_t corrected;        ///< outputs that okid_skew_correct() puts right
    const double* delay;      ///< n_y, s, > 0: the output shows what was there so much earlier
    const double* std;        ///< n_y, s
    const int32_t* late;      ///< n_y: 1 = to be corrected: over 4 deviations, at most 0.3 samples, not undetermined
    const int32_t* too_large; ///< n_y: 1 = over 4 deviations and over 0.3 samples: the hold or a shift is likelier
    double scatter; ///< rms of what is left of the angles over its deviations (1e-4 rad at least): 1 is chance
} okid_skew_result_t;

/// Bytes okid_skew_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_skew_memsize(const okid_skew_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_skew_create(okid_skew_t** self, const okid_skew_config_t* config,
                                                       void* block, size_t bytes);

/// Restart with a model: the angles of the modes that okid_mkr_identify() takes.
/// @return OKID_OK, OKID_ERR_NULL, or the errors of okid_mkr_identify()
OKID_NODISCARD OKID_API okid_status_t okid_skew_begin(okid_skew_t* self, const okid_model_t* model);

/// Add a model of the record without one of equal blocks (okid_refine_replicate()). Modes are matched by their poles.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (no begin), OKID_ERR_RANGE (more than configured), OKID_ERR_NUMERIC
OKID_NODISCARD OKID_API okid_status_t okid_skew_add(okid_skew_t* self, const okid_model_t* replicate);

/// Delays by least squares over the modes, each angle weighted by its variance, and their deviations.
/// @return OKID_OK; OKID_WARN_MODEL: undetermined; OKID_ERR_NULL, OKID_ERR_TOO_SHORT (fewer than two replicates)
OKID_NODISCARD OKID_API okid_status_t okid_skew_finish(okid_skew_t* self, okid_skew_result_t* out);

/// C and D of the model of begin() as they were without the delays that are `late`. The modes are turned back by
/// e^(lambda tau). A held force (zero hold) acts on an accelerometer that is late one sample later: D is taken from there.
/// Such a row of C keeps the modes of the structure alone. With the first hold D stays.
/// @param C, D  out, n_y x n_z and n_y x n_u @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (not after finish())
OKID_NODISCARD OKID_API okid_status_t okid_skew_correct(okid_skew_t* self, okid_real_t* C, okid_real_t* D);

#ifdef __cplusplus
}
#endif
#endif
