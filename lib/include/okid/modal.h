// SPDX-License-Identifier: MIT
/// @file modal.h
/// Natural frequencies, damping ratios and mode shapes of a discrete state-space model.
#ifndef OKID_MODAL_H
#define OKID_MODAL_H

#include <okid/model.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bytes of work with the Eigen backend, for static arrays: never less than okid_modal_memsize(), and at most 0.7 KiB more.
#define OKID_MODAL_BYTES(n_z)                                                                                          \
    (640 + (size_t)(n_z) * (sizeof(okid_real_t) * (3 * (size_t)(n_z) + 5) + sizeof(double) + sizeof(int)))

/// Bytes of work for a model of n_z states and n_y outputs.
OKID_API size_t okid_modal_memsize(int32_t n_y, int32_t n_z);

/// Modes of a model, in arrays of the caller with room for n_z/2 modes each; a NULL array is not written. In a column-major
/// array a column is a mode.
typedef struct okid_modes_t {
    int32_t count;              ///< out: modes found, <= n_z/2
    double radius;              ///< out: spectral radius of A
    okid_real_t* frequency_hz;  ///< |lambda|/(2 pi), ascending
    okid_real_t* damping_ratio; ///< -Re lambda/|lambda|
    okid_real_t* mpc;           ///< modal phase collinearity of the shape, 0..1
    okid_real_t* shape_re;      ///< n_y x modes: C psi, the largest entry scaled to 1; both or neither NULL
    okid_real_t* shape_im;      ///< its imaginary part
    okid_real_t* mu_re;         ///< eigenvalue of A
    okid_real_t* mu_im;         ///< its imaginary part
    okid_real_t* psi_re;        ///< n_z x modes: eigenvector of A
    okid_real_t* psi_im;        ///< its imaginary part
} okid_modes_t;

/// The underdamped pairs 0 < zeta < 1 below Nyquist, ascending in frequency. Real poles, unstable poles and pairs within
/// 1 % of Nyquist are left out (their frequency is ambiguous). With mu an eigenvalue of A: lambda = log(mu)/dt.
/// @param model  in, A, C, n_y and n_z; the rest is not read
/// @param dt     s
/// @param modes  in: the arrays, shapes are needed for mpc; out: what they hold
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_NUMERIC
OKID_NODISCARD OKID_API okid_status_t okid_modal_analyse(const okid_model_t* model, double dt, okid_modes_t* modes,
                                                         void* work, size_t bytes);

/// Modal assurance criterion of two complex shapes of n entries: |a^H b|^2 / (a^H a)(b^H b), 0..1.
OKID_API double okid_modal_mac(int32_t n, const okid_real_t* a_re, const okid_real_t* a_im, const okid_real_t* b_re,
                               const okid_real_t* b_im);

#ifdef __cplusplus
}
#endif
#endif
