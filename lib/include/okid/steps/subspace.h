// SPDX-License-Identifier: MIT
/// @file steps/subspace.h
/// Subspace identification (N4SID): MOESP, CVA and SSARX from the Gram matrix of the lagged samples, or from their
/// triangular factor (paper eq. 55-95; Jansson 2003 for SSARX).
///
/// Hankel matrices of the samples are never formed. Their rows are the lagged samples w_n = [v_n; ..; v_(n-2i+1)], so
/// that an accumulator with lags = 2 i - 1 holds all that is needed: the LQ factor of the Hankel rows is, up to the
/// order of the rows, the Cholesky factor of its Gram matrix. Live records, windows, merged records: as the
/// accumulator. okid_subspace_decompose() does the large work once, okid_subspace_realize() then makes a model of any
/// order from it. Models of output-only records (n_u = 0) have A, C, K; B and D have no columns.
/// Redundant, band-limited channels (real arrays) give models of high order with spurious poles outside the unit
/// circle; a ridge of 1e-4..1e-2 brings them in and leaves the modes (numerics.md, trap 22).
#ifndef OKID_STEPS_SUBSPACE_H
#define OKID_STEPS_SUBSPACE_H

#include <okid/modal.h>

#ifdef __cplusplus
extern "C" {
#endif

/// How the prediction of the future outputs is weighted before its rank is cut (paper table 1; SSARX: Jansson 2003).
typedef enum okid_subspace_method_t {
    OKID_SUBSPACE_MOESP = 0, ///< W1 = I
    OKID_SUBSPACE_CVA = 1,   ///< W1 = (covariance of the future outputs less the future inputs)^(-1/2)
    OKID_SUBSPACE_SSARX = 2  ///< canonical correlations of the past with the future corrected by an ARX model of i lags
} okid_subspace_method_t;

/// Sizes, the method, and the ridge.
typedef struct okid_subspace_config_t {
    int32_t n_u;       ///< inputs, >= 0; 0 = output-only
    int32_t n_y;       ///< outputs, >= 1
    int32_t rows;      ///< i, block rows of past and of future, >= 2; 2 i (n_u + n_y) <= 32768
    int32_t method;    ///< okid_subspace_method_t
    int32_t max_order; ///< largest order that will be asked for, >= 0; 0 = min(128, (i-1) n_y)
    int32_t factor;    ///< 1 = room for okid_subspace_decompose_factor(): 2 (i m)^2 numbers more
    double ridge;      ///< on the unit-diagonal Gram, 0..1; 0 = what rounding needs: 1e-13, from a factor eps
} okid_subspace_config_t;

/// MOESP with 30 block rows.
static inline okid_subspace_config_t okid_subspace_defaults(int32_t n_u, int32_t n_y) {
    const okid_subspace_config_t config = {n_u, n_y, 30, OKID_SUBSPACE_MOESP, 0, 0, 0};
    return config;
}

/// What the decomposition found, beside the factors.
typedef struct okid_subspace_info_t {
    double ridge;            ///< ridge used, relative to the unit-diagonal Gram matrix
    double input_excitation; ///< smallest over largest pivot of the inputs in the unit-diagonal Gram; near 0 = poor
    int32_t channel;         ///< the channel an error speaks of, else -1
} okid_subspace_info_t;

/// Holds factors and workspace. Private; lives in the caller's block.
typedef struct okid_subspace okid_subspace_t;

/// Largest order a realization can have: max_order, at most (i-1) n_y; 0 when the configuration is invalid.
OKID_API int32_t okid_subspace_max_order(const okid_subspace_config_t* config);

/// Bytes okid_subspace_create() needs; 0 when the configuration is invalid. Some 10 (SSARX: 13) (i m)^2 doubles, more
/// when max_order comes near i n_y.
OKID_API size_t okid_subspace_memsize(const okid_subspace_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_subspace_create(okid_subspace_t** self, const okid_subspace_config_t* config,
                                                           void* block, size_t bytes);

/// Factor, weight and cut: everything up to the choice of the order (eq. 68-79).
/// @param gram  in, 2 i m x 2 i m column-major of okid_accumulator_gram() with lags = 2 i - 1
/// @param rows  in, Hankel columns behind it (okid_accumulator_rows()), at least 2 i m
/// @param info  out
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_TOO_SHORT, OKID_ERR_INPUT, OKID_ERR_OUTPUT, OKID_ERR_EXCITATION,
///         OKID_ERR_NUMERIC; after an error there is nothing to realize
/// Cost (2 i m)^3/3 flop, an SVD of i n_y x i m, for SSARX some 2 n_y m i^2 (2 i m) flop more.
OKID_NODISCARD OKID_API okid_status_t okid_subspace_decompose(okid_subspace_t* self, const double* gram, int64_t rows,
                                                              okid_subspace_info_t* info);

/// The same from the factor R of the rows: the condition of the data is not squared. For noise-free and nearly
/// noise-free records. Needs config.factor = 1.
/// @param factor  in, 2 i m x 2 i m of okid_square_root_factor() with lags = 2 i - 1
/// @return also OKID_ERR_MISMATCH (created without room for it). Cost 2 (2 i m)^3 flop in place of (2 i m)^3/3.
OKID_NODISCARD OKID_API okid_status_t okid_subspace_decompose_factor(okid_subspace_t* self, const okid_real_t* factor,
                                                                     int64_t rows, okid_subspace_info_t* info);

/// The i n_y singular values, descending; *count of them. MOESP: of L32 as it is (growing with sqrt(rows)); CVA and
/// SSARX: canonical correlations, 0..1.
OKID_API const okid_real_t* okid_subspace_singular_values(const okid_subspace_t* self, int32_t* count);

/// Model of one order. MOESP and CVA: A by shift invariance and C from the observability matrix (eq. 84-86), B and D by
/// joint least squares on (87) with the inputs as they were (not the product (93)), K and the innovation covariance by
/// the Riccati equation of the residuals of the state sequences. SSARX: all by regression of the states, K by the same
/// Riccati equation.
/// @param order  n_z in 1..okid_subspace_max_order()
/// @param A      out, n_z x n_z
/// @param B, D   out, n_z x n_u and n_y x n_u, both or neither NULL
/// @param C      out, n_y x n_z
/// @param K      out, n_z x n_y Kalman gain (A - K C is stable), may be NULL
/// @param innovation  out, n_y x n_y covariance, may be NULL
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (order out of range, or more than the singular values carry),
///         OKID_ERR_NUMERIC. A alone costs 2 n_z^3; B and D add n_u^2 i n_z^2 (i + 2 n_z) + n_u^3 i n_z (n_z + n_y)^2
///         flop
OKID_NODISCARD OKID_API okid_status_t okid_subspace_realize(okid_subspace_t* self, int32_t order, okid_real_t* A,
                                                            okid_real_t* B, okid_real_t* C, okid_real_t* D,
                                                            okid_real_t* K, okid_real_t* innovation);

/// EMAC of eigenvectors (Pappa, Elliott, Schenk 1993, output side): how well C A^(i-1) psi agrees with the last block
/// row of the identified observability matrix; 0..1 per eigenvector.
/// @param C      in, n_y x n_z of the realization
/// @param modes  in, count, eigenvalues mu and eigenvectors psi of its A, by okid_modal_analyse()
/// @param emac   out, count numbers. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM
OKID_NODISCARD OKID_API okid_status_t okid_subspace_emac(const okid_subspace_t* self, int32_t order,
                                                         const okid_real_t* C, const okid_modes_t* modes,
                                                         okid_real_t* emac);

/// Bytes of work of okid_subspace_output_error(), O((n_z + n_y)^2 (n_u + 1)^2) and n_z n_u (n_z + n_y) numbers a
/// record; 0 when a size is invalid.
OKID_API size_t okid_subspace_output_error_memsize(int32_t n_u, int32_t n_y, int32_t n_z, int32_t records);

/// B, D and the initial states that make the simulated outputs fit the records best, for given A and C: linear least
/// squares through modal filters, normal equations summed sample by sample. Memory does not grow with the length of a
/// record. A sample with a missing output (NaN or infinite) is left out. After a missing input the state is unknown: a
/// new initial state is estimated from there on (and not returned).
/// @param model    in, A, C and the sizes; the eigenvectors of A must be independent; the rest is not read
/// @param records  in, the records one after the other
/// @param B, D     out, n_z x n_u and n_y x n_u; not touched when n_u = 0
/// @param x0       out, n_z x records: the state at the first sample of each; may be NULL
/// @param work     caller's block of okid_subspace_output_error_memsize() bytes
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_TOO_SHORT, OKID_ERR_NUMERIC (also when an
///         unstable A runs out of range)
/// Cost (n_z n_u + n_z + n_u)^2 flop a sample. Source: docs/numerics.md, output error.
OKID_NODISCARD OKID_API okid_status_t okid_subspace_output_error(const okid_model_t* model,
                                                                 const okid_records_t* records, okid_real_t* B,
                                                                 okid_real_t* D, okid_real_t* x0, void* work,
                                                                 size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
