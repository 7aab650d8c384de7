// SPDX-License-Identifier: MIT
/// @file modal.h
/// Natural frequencies, damping ratios and mode shapes of a discrete state-space model.
#ifndef OKID_MODAL_H
#define OKID_MODAL_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bytes of work with the Eigen backend, for static arrays: never less than okid_modal_memsize(), and at most 0.7 KiB more.
#define OKID_MODAL_BYTES(n_z)                                                                                          \
    (640 + (size_t)(n_z) * (sizeof(okid_real_t) * (3 * (size_t)(n_z) + 5) + sizeof(double) + sizeof(int)))

/// Bytes of work for a model of n_z states and n_y outputs.
OKID_API size_t okid_modal_memsize(int32_t n_y, int32_t n_z);

/// The underdamped pairs 0 < zeta < 1 below Nyquist, ascending in frequency. Real poles, unstable poles and pairs within
/// 1 % of Nyquist are left out (their frequency is ambiguous).
/// With mu an eigenvalue of A: lambda = log(mu)/dt, f = |lambda|/(2 pi), zeta = -Re lambda/|lambda|, shape = C psi.
/// @param A, C   in, n_z x n_z and n_y x n_z column-major; @param dt  s
/// @param count  out, modes found (<= n_z/2)
/// @param frequency_hz, damping_ratio, mpc   out, room for n_z/2 each. mpc: modal phase collinearity 0..1 of the shape
/// @param shape_re, shape_im  out, n_y x n_z/2, largest entry scaled to 1
/// @param mu_re, mu_im, psi_re, psi_im  out or NULL: eigenvalues (n_z/2) and eigenvectors (n_z x n_z/2) of those modes
/// @param radius  out or NULL: spectral radius of A
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_NUMERIC
OKID_NODISCARD OKID_API okid_status_t okid_modal_analyse(int32_t n_y, int32_t n_z, double dt, const okid_real_t* A,
                                                         const okid_real_t* C, int32_t* count,
                                                         okid_real_t* frequency_hz, okid_real_t* damping_ratio,
                                                         okid_real_t* mpc, okid_real_t* shape_re, okid_real_t* shape_im,
                                                         okid_real_t* mu_re, okid_real_t* mu_im, okid_real_t* psi_re,
                                                         okid_real_t* psi_im, double* radius, void* work, size_t bytes);

/// Modal assurance criterion of two complex shapes of n entries: |a^H b|^2 / (a^H a)(b^H b), 0..1.
OKID_API double okid_modal_mac(int32_t n, const okid_real_t* a_re, const okid_real_t* a_im, const okid_real_t* b_re,
                               const okid_real_t* b_im);

#ifdef __cplusplus
}
#endif
#endif
