// SPDX-License-Identifier: MIT
// PURPOSE    tridiagonal form of a symmetric matrix of some ten to some hundred rows, where a call of LAPACK costs more than its work
#ifndef OKID_TRIDIAGONAL_H
#define OKID_TRIDIAGONAL_H

#ifdef __cplusplus
extern "C" {
#endif

enum { OKID_TRIDIAGONAL_PAD = 8 };

/// a: lower triangle of n x n, ld n + OKID_TRIDIAGONAL_PAD, zeros in the rows behind. d (n), e (n - 1): the form; tau (n) and a
/// below its subdiagonal: reflectors. spare: 4 (n + OKID_TRIDIAGONAL_PAD) zeros.
typedef void okid_reduce_fn(int n, double* a, double* d, double* e, double* tau, double* spare);

/// The reflectors applied to `count` columns of n numbers.
typedef void okid_reflect_fn(int n, const double* a, const double* tau, int count, double* columns);

typedef struct okid_tridiagonal_t {
    okid_reduce_fn* reduce;
    okid_reflect_fn* reflect;
} okid_tridiagonal_t;

/// The fastest this processor runs.
okid_tridiagonal_t okid_tridiagonal_pick(void);

#ifdef __cplusplus
}
#endif
#endif
