// SPDX-License-Identifier: MIT
/// @file steps/era.h
/// Eigensystem realization algorithm (paper eq. 43-54), Hankel matrix of the system Markov parameters only (trap 1);
/// the observer gain follows by least squares from the observer-gain Markov parameters. With tau > 0 the data
/// correlations H(k) H(0)^T are realized in place of H(k): ERA/DC (Juang, Cooper, Wright 1988).
#ifndef OKID_STEPS_ERA_H
#define OKID_STEPS_ERA_H

#include <okid/modal.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes of the Hankel matrix, and of the correlations of ERA/DC.
typedef struct okid_era_config_t {
    int32_t n_u;  ///< inputs, >= 1
    int32_t n_y;  ///< outputs, >= 1
    int32_t rows; ///< r, block rows of H(0)
    int32_t cols; ///< c, block columns
    int32_t xi;   ///< ERA/DC: xi + 1 block rows of correlations, 0..64; ERA: 0
    int32_t zeta; ///< ERA/DC: zeta + 1 block columns, 0..64; ERA: 0
    int32_t tau;  ///< ERA/DC: lag between the correlations, 1..min(r, c); 0 = ERA
} okid_era_config_t;

/// ERA with a square Hankel matrix.
static inline okid_era_config_t okid_era_defaults(int32_t n_u, int32_t n_y, int32_t rows) {
    const okid_era_config_t config = {n_u, n_y, rows, rows, 0, 0, 0};
    return config;
}

/// The last Markov parameter that is needed: Y_0 .. Y_n with n = r + c + (xi + zeta) tau.
OKID_API int32_t okid_era_markov_last(const okid_era_config_t* config);

/// One decomposition, many orders. Private; lives in the caller's block.
typedef struct okid_era okid_era_t;

/// Bytes of the block with the Eigen backend and tau = 0 (ERA), for static arrays: never less than okid_era_memsize(), and
/// at most 1.2 KiB more where cols n_u >= n_y.
#define OKID_ERA_BYTES(n_u, n_y, rows, cols)                                                                           \
    (1024 + sizeof(okid_real_t) *                                                                                      \
                OKID_ERA_NUMBERS_((size_t)(rows) * (n_y), (size_t)(cols) * (n_u), (size_t)(n_u), (size_t)(n_y)))
/// @cond
#define OKID_ERA_NUMBERS_(height, breadth, n_u, n_y)                                                                   \
    ((height) < (breadth) ? OKID_ERA_ORDERED_(height, breadth, height, breadth, n_u, n_y)                              \
                          : OKID_ERA_ORDERED_(height, breadth, breadth, height, n_u, n_y))
#define OKID_ERA_ORDERED_(height, breadth, k, tall, n_u, n_y)                                                          \
    ((height) * (breadth) + ((height) + (breadth)) * (k) + (tall) * (k) + 3 * (k) * (k) + 3 * (k) +                    \
     ((n_y) > (k) ? (height) * ((n_y) - (k)) : 0) + (k) * ((n_u) > (n_y) ? (n_u) : (n_y)))
/// @endcond

/// Bytes okid_era_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_era_memsize(const okid_era_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_era_create(okid_era_t** self, const okid_era_config_t* config, void* block,
                                                      size_t bytes);

/// ERA: H(0) = R Sigma S^T (eq. 48). ERA/DC: the same of the block Hankel matrix [RR((a+b) tau)] of the correlations
/// RR(k) = H(k) H(0)^T, a = 0..xi, b = 0..zeta.
/// @param markov  in, Y_0 .. Y_(okid_era_markov_last()), n_y x n_u blocks, column-major
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_NUMERIC. Cost of an SVD of (r n_y) x (c n_u); ERA/DC: of
/// ((r + xi tau) n_y) x ((c + zeta tau) n_u) and of ((c + zeta tau) n_u) x ((zeta + 1) r n_y).
OKID_NODISCARD OKID_API okid_status_t okid_era_decompose(okid_era_t* self, const okid_real_t* markov);

/// The singular values of the matrix that was decomposed, descending; *count of them.
OKID_API const okid_real_t* okid_era_singular_values(const okid_era_t* self, int32_t* count);

/// Largest order a realization can have.
OKID_API int32_t okid_era_max_order(const okid_era_config_t* config);

/// A, B, C of one order (eq. 54), D = Y_0 is the caller's; ERA/DC: B and K by least squares on the first r block rows
/// of the observability matrix. @param order n_z in 1..max
/// @param A  out n_z x n_z, B out n_z x n_u, C out n_y x n_z, column-major
/// @param gain_markov  in, Y0_1 .. Y0_rows (n_y x n_y) or NULL; @param K  out n_z x n_y, Kalman gain = -L, or NULL
OKID_NODISCARD OKID_API okid_status_t okid_era_realize(okid_era_t* self, int32_t order, okid_real_t* A, okid_real_t* B,
                                                       okid_real_t* C, const okid_real_t* gain_markov, okid_real_t* K);

/// A and C of other Markov parameters in the singular subspaces that were decomposed, to first order in their difference:
/// what a part of the record does to the modes, without another decomposition. With the parameters that were decomposed
/// they are A and C of okid_era_realize(). Not with tau > 0 (OKID_ERR_DIM).
/// @param markov  in, Y_0 .. Y_(okid_era_markov_last())
/// @param A  out n_z x n_z, C out n_y x n_z, column-major
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM. Cost 4 (r n_y) (c n_u) n_z flop
OKID_NODISCARD OKID_API okid_status_t okid_era_realize_near(okid_era_t* self, int32_t order, const okid_real_t* markov,
                                                            okid_real_t* A, okid_real_t* C);

/// EMAC of eigenvectors (Pappa, Elliott, Schenk 1993, output side): how well C A^k psi at the last block row of the
/// identified observability matrix agrees with its prediction from the first; 0..1 per eigenvector.
/// @param modes  in, count, eigenvalues mu and eigenvectors psi of A, by okid_modal_analyse()
/// @param emac   out, count numbers
OKID_NODISCARD OKID_API okid_status_t okid_era_emac(const okid_era_t* self, int32_t order, const okid_modes_t* modes,
                                                    okid_real_t* emac);

#ifdef __cplusplus
}
#endif
#endif
