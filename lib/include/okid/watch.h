// SPDX-License-Identifier: MIT
/// @file watch.h
/// Does a model still predict what comes? Its one-step predictor runs along with the stream; when the errors rise and stay
/// high the structure has changed, long before the samples from before have left a window, and while these mix with the new
/// ones no estimate is of any use: forget them (okid_accumulator_reset()) and identify again.
#ifndef OKID_WATCH_H
#define OKID_WATCH_H

#include <okid/identify.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes, and what counts as a change; 0 is the default of a criterion.
typedef struct okid_watch_config_t {
    int32_t n_u;       ///< inputs, 0..4096
    int32_t n_y;       ///< outputs, 1..4096
    int32_t max_order; ///< states of a model, at most; 1..4096
    int32_t lead;      ///< samples from which a predictor finds its state, >= 0: the lags of the observer
    int32_t block;     ///< samples judged together; 0 = 32
    int32_t learn;     ///< blocks that teach what errors are usual; 0 = 16, at most 1024
    int32_t confirm;   ///< consecutive blocks with high errors that are a change; 0 = 3
    double ratio;      ///< high is this many times the usual; 0 = 3
} okid_watch_config_t;

/// Every criterion at its default.
static inline okid_watch_config_t okid_watch_defaults(int32_t n_u, int32_t n_y, int32_t max_order, int32_t lead) {
    const okid_watch_config_t config = {n_u, n_y, max_order, lead, 0, 0, 0, 0};
    return config;
}

/// What it is doing.
typedef struct okid_watch_state_t {
    int32_t watching; ///< 1: a model is at work whose usual errors are known
    int32_t learning; ///< 1: another one is being learned about, and takes over then
    int32_t high;     ///< consecutive blocks with high errors so far
    double ratio;     ///< error of the newest block / usual error (mean squares)
} okid_watch_state_t;

/// Private; lives in the caller's block.
typedef struct okid_watch okid_watch_t;

/// Bytes okid_watch_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_watch_memsize(const okid_watch_config_t* config);
/// Lay one without a model out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_watch_create(okid_watch_t** self, const okid_watch_config_t* config,
                                                        void* block, size_t bytes);

/// Give it a model, which is copied. It takes over from the one at work once its usual errors are known.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (sizes), OKID_ERR_UNSTABLE (its predictor), OKID_ERR_NUMERIC (innovation
///         covariance not positive definite); the model at work stays on an error
OKID_NODISCARD OKID_API okid_status_t okid_watch_set_model(okid_watch_t* self, const okid_identified_t* model);

/// A sample in the units of the model, inputs first. O(n_z (n_z + m)); the last of `lead` behind a gap: `lead` times that. Errors
/// are high when their mean square over a block is `ratio` times the usual one, and also in proportion to the mean square of
/// the outputs: noise that grows with the excitation (ambient records) is no change, and neither is excitation that ends.
/// @return 1: a change; `confirm` * `block` samples ago it began. The watch is idle then, until it is given a model. Else 0
OKID_API int32_t okid_watch_add(okid_watch_t* self, const okid_real_t* sample);

/// Samples are missing here: the predictors find their states again.
OKID_API void okid_watch_gap(okid_watch_t* self);

/// No model any more.
OKID_API void okid_watch_reset(okid_watch_t* self);

/// What it is doing now. @param out  out
OKID_API void okid_watch_state(const okid_watch_t* self, okid_watch_state_t* out);

#ifdef __cplusplus
}
#endif
#endif
