// SPDX-License-Identifier: MIT
/// @file model.h
/// A discrete state-space model at work: simulation, one-step prediction, initial state (paper eq. 13, 15, 16, 20).
#ifndef OKID_MODEL_H
#define OKID_MODEL_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Views of a model; column-major. K may be NULL.
typedef struct okid_model_t {
    int32_t n_u;          ///< inputs
    int32_t n_y;          ///< outputs
    int32_t n_z;          ///< states
    const okid_real_t* A; ///< n_z x n_z
    const okid_real_t* B; ///< n_z x n_u
    const okid_real_t* C; ///< n_y x n_z
    const okid_real_t* D; ///< n_y x n_u
    const okid_real_t* K; ///< n_z x n_y, Kalman gain: x+ = A x + B u + K (y - C x - D u)
} okid_model_t;

/// Views of measured records, one after the other.
typedef struct okid_records_t {
    int32_t count;         ///< records, >= 1
    const int32_t* counts; ///< count: samples of each
    const double* samples; ///< column-major m x (sum of counts), inputs, then outputs
} okid_records_t;

/// Numbers (okid_real_t) of scratch the three functions below need.
OKID_API size_t okid_model_workspace(const okid_model_t* model);

/// y_n = C x_n + D u_n, x_(n+1) = A x_n + B u_n (eq. 13, 15).
/// @param u  in, n_u x count; @param x0  in, n_z or NULL (0); @param y  out, n_y x count; work: workspace() numbers
OKID_NODISCARD OKID_API okid_status_t okid_model_simulate(const okid_model_t* model, const okid_real_t* u, size_t count,
                                                          const okid_real_t* x0, okid_real_t* y, okid_real_t* work);

/// One-step predictor yhat_n from the samples before n and u_n. A sample with a NaN is skipped (no correction).
/// @param y  in, n_y x count measured; @param yhat  out, n_y x count
OKID_NODISCARD OKID_API okid_status_t okid_model_predict(const okid_model_t* model, const okid_real_t* u,
                                                         const okid_real_t* y, size_t count, const okid_real_t* x0,
                                                         okid_real_t* yhat, okid_real_t* work);

/// Least-squares initial state: the x0 for which simulation over the record fits best in the output-error sense.
/// Samples of y with a NaN carry no weight; a NaN in u counts as 0. @param x0  out, n_z
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_NUMERIC
OKID_NODISCARD OKID_API okid_status_t okid_model_initial_state(const okid_model_t* model, const okid_real_t* u,
                                                               const okid_real_t* y, size_t count, okid_real_t* x0,
                                                               okid_real_t* work);

/// Bytes of scratch okid_model_fit() needs; 0: sizes that are no model.
OKID_API size_t okid_model_fit_memsize(const okid_model_t* model);

/// How much of measured outputs the model leaves: all of a record in one pass, simulation and one-step prediction side by
/// side, both from x0. A sample whose outputs have a NaN corrects no state. Without K the prediction is the simulation.
/// @param rows  in, (n_u + n_y) x count: inputs, without a NaN, then outputs; @param x0  in, n_z or NULL (0)
/// @param sums  in and out, n_y x 5: squares left by simulation, by prediction; sum, squares and count of what was measured
/// @param work  okid_model_fit_memsize() bytes
OKID_NODISCARD OKID_API okid_status_t okid_model_fit(const okid_model_t* model, const double* rows, size_t count,
                                                     const okid_real_t* x0, double* sums, void* work, size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
