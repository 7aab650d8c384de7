// SPDX-License-Identifier: MIT
/// @file refine.h
/// Maximum-likelihood refinement of an identified model: the poles, B, C, D and initial states whose simulated outputs
/// are the likeliest, for white noise at the sensors. From a start that is near enough it reaches the Cramér-Rao bound.
///
/// The noise of every output is white, Gaussian, of its own unknown size and independent of the others: what is minimised
/// is the sum over the outputs of N/2 log(mean square of y - yhat). With noise inside the structure (unmeasured forces) the
/// result is still consistent as long as the inputs do not depend on the outputs (no feedback).
#ifndef OKID_REFINE_H
#define OKID_REFINE_H

#include <okid/correlation.h>
#include <okid/model.h>
#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes of the model and of the record; n_z (n_u + runs + 1) + n_u + runs <= 16384.
typedef struct okid_refine_config_t {
    int32_t n_u; ///< inputs; 0: free decays, of the initial states of the runs
    int32_t n_y; ///< outputs, >= 1
    int32_t n_z; ///< states of the model, >= 1
    int32_t
        runs; ///< stretches of samples without a missing input, each with an initial state of its own; 0: refine from sums (n_u > 0)
    int32_t blocks;     ///< 2..64: room for that many delete-one-block replicates; 0: none
    int32_t iterations; ///< at most; 0 = 30
    int32_t offset;     ///< 1: every run has an unknown constant in every output (records less their mean); 0: none
} okid_refine_config_t;

/// One run, no replicates, no offsets.
static inline okid_refine_config_t okid_refine_defaults(int32_t n_u, int32_t n_y, int32_t n_z) {
    const okid_refine_config_t config = {n_u, n_y, n_z, 1, 0, 0, 0};
    return config;
}

/// The result; the arrays live in the block until the next run.
typedef struct okid_refined_t {
    int32_t iterations;    ///< steps taken
    int32_t converged;     ///< 1: what a further step promises is nothing beside the noise. 0: the best point reached
    int64_t samples;       ///< used: those with all outputs
    double gain;           ///< of the log-likelihood over the start (with the best initial states), >= 0
    double decrement;      ///< log-likelihood that one more step promises
    double whiteness;      ///< mean of N r^2 over the autocorrelations of the residuals at lags 1..20: 1 when white
    const okid_real_t* A;  ///< n_z x n_z, in the states of the start: its Kalman gain goes with them
    const okid_real_t* B;  ///< n_z x n_u
    const okid_real_t* C;  ///< n_y x n_z
    const okid_real_t* D;  ///< n_y x n_u
    const okid_real_t* x0; ///< n_z x runs, at the first sample of each
    const okid_real_t* noise_std; ///< n_y, of the residuals, their degrees of freedom counted
} okid_refined_t;

/// Holds workspace and result. Private; lives in the caller's block.
typedef struct okid_refine okid_refine_t;

/// Bytes okid_refine_create() needs; 0 when the configuration is invalid. Some 5 (n_z (n_u + runs + 1) + n_u + runs)^2
/// doubles; does not grow with the number of samples.
OKID_API size_t okid_refine_memsize(const okid_refine_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_refine_create(okid_refine_t** self, const okid_refine_config_t* config,
                                                         void* block, size_t bytes);

/// Refine. Levenberg-Marquardt in modal coordinates: real poles stay real, pairs stay pairs, stable poles stay stable.
/// The likelihood never falls below that of the start.
/// @param start    in, A, B, C, D (K is not read); the eigenvectors of A must be independent and all poles stable
/// @param counts   in, samples of each run
/// @param samples  in, column-major m x (sum of counts), inputs, then outputs; the runs one after the other. A sample with
///                 a missing output (NaN or infinite) is left out as a whole
/// @param out      out
/// @return OKID_OK; OKID_WARN_MODEL (valid, not converged); OKID_ERR_NULL; OKID_ERR_MISMATCH (sizes of the model, or a
///         missing input); OKID_ERR_TOO_SHORT; OKID_ERR_UNSTABLE (the start); OKID_ERR_NUMERIC
/// Cost of an iteration: (n_z (n_u + 2) + n_u)^2 + 2 n_y (n_z n_u + n_z) flop a sample; one pass more for the replicates.
/// Source: docs/numerics.md, refinement; Ljung, System Identification (1999) ch. 7, 10.
OKID_NODISCARD OKID_API okid_status_t okid_refine_run(okid_refine_t* self, const okid_model_t* start,
                                                      const int32_t* counts, const double* samples,
                                                      okid_refined_t* out);

/// Refine from correlation sums instead of the record: the same likelihood of the rows in them, for an object with runs = 0.
/// Cost: nothing a sample; (16 m n_u n_z L + 8 (2 n_u n_z)^2 (n_u^2 + 2 pieces)) flop an iteration. The record-based refinement is the
/// better one where the lags cost too many rows (records shorter than some 3 L, free decays) or where there is no noise:
/// what a mode still rings after L lags (|w|^L of it) is left out here.
/// @param sums  in, of okid_correlation_sums(), with the means taken off or not
/// @param out   out; x0 is NULL; samples: rows of the sums; whiteness: 0, unknown
/// @return OKID_OK; OKID_WARN_MODEL (valid, not converged); OKID_ERR_NULL; OKID_ERR_MISMATCH; OKID_ERR_TOO_SHORT;
///         OKID_ERR_UNSTABLE (a pole of the start still has 1 % of its amplitude after L lags); OKID_ERR_NUMERIC
/// Source: docs/numerics.md, refinement from sums.
OKID_NODISCARD OKID_API okid_status_t okid_refine_from_correlation(okid_refine_t* self, const okid_model_t* start,
                                                                   const okid_correlation_sums_t* sums,
                                                                   okid_refined_t* out);

/// The model that block `index` of `blocks` (equal numbers of used samples) left out would give, to first order: one step
/// from the result with the scores of the block. Over all blocks they scatter as jackknife replicates do:
/// variance = (blocks - 1)/blocks sum of (replicate - mean)^2. White residuals are not assumed. After
/// okid_refine_from_correlation(), which knows no blocks, and without inputs, where a fast mode lives in one block, they are draws
/// with the covariance of the Cramér-Rao bound at the noise found, for the same formula (the same ones in every run; 64 of them give
/// a deviation to 9 %).
/// @param index  0..blocks-1; @param A, B, C, D  out, sizes of the model
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MISMATCH (no run before, or no blocks)
OKID_NODISCARD OKID_API okid_status_t okid_refine_replicate(okid_refine_t* self, int32_t index, okid_real_t* A,
                                                            okid_real_t* B, okid_real_t* C, okid_real_t* D);

#ifdef __cplusplus
}
#endif
#endif
