// SPDX-License-Identifier: MIT
// PURPOSE    Cholesky factor of a matrix of some ten to some hundred rows
#ifndef OKID_CHOLESKY_H
#define OKID_CHOLESKY_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Lower triangle of a (n x n, column-major, ld >= n) <- L with a = L L^T; what stands above the diagonal is not looked at and
/// stays. @return 0, or 1 + the first column whose pivot is not positive
typedef int okid_cholesky_fn(int n, double* a, size_t ld);

/// The fastest this processor runs; NULL: LAPACK's is faster for matrices so large.
okid_cholesky_fn* okid_cholesky_pick(int n);

#ifdef __cplusplus
}
#endif
#endif
