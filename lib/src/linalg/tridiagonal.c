// SPDX-License-Identifier: MIT
// PURPOSE    Householder reduction of a symmetric matrix to tridiagonal form, one source for every instruction set
// METHOD     the rank-2 update of a step and the product with the next reflector in one pass over the triangle, two columns at a
//            time: each entry is read and written once a step
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 8.3.1; Cavers (1994) for the joined pass
// NUMERICS   backward stable: every eigenvalue keeps the absolute error of the largest
// WORKSPACE  4 (n + 8) numbers; 4/3 n^3 flop
#include "tridiagonal.h"
#include "accumulate/isa.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define REDUCE OKID_FOR_ISA(okid_reduce_)
#define REFLECT OKID_FOR_ISA(okid_reflect_)

enum { PAD = OKID_TRIDIAGONAL_PAD };
typedef double lanes_t __attribute__((vector_size(PAD * sizeof(double)), aligned(8)));
#define GET(p) (*(const lanes_t*)(p))
#define PUT(p, v) (*(lanes_t*)(p) = (v))
#define SUM(v) (((v)[0] + (v)[4]) + ((v)[1] + (v)[5]) + (((v)[2] + (v)[6]) + ((v)[3] + (v)[7])))

/// The vectors of a step, n numbers and zeros behind: the last update A - v p^T - p v^T, the next reflector, its product.
typedef struct step_t {
    const double *v, *p, *next;
    double* product;
} step_t;

/// Columns j and j + 1 from their diagonals down: updated, and multiplied.
static void two_columns(int n, double* a, double* b, int j, const step_t* s) {
    const double *v = s->v, *p = s->p, *w = s->next, vj = v[j], pj = p[j], vk = v[j + 1], pk = p[j + 1];
    a[j] -= 2 * vj * pj;
    a[j + 1] -= vk * pj + pk * vj;
    b[j + 1] -= 2 * vk * pk;
    const double wj = w[j], wk = w[j + 1];
    lanes_t own_j = {0}, own_k = {0};
    for (int i = j + 2; i < n; i += PAD) {
        const lanes_t vi = GET(v + i), pi = GET(p + i), wi = GET(w + i);
        const lanes_t x = GET(a + i) - (vi * pj + pi * vj), y = GET(b + i) - (vi * pk + pi * vk);
        PUT(a + i, x);
        PUT(b + i, y);
        own_j += x * wi;
        own_k += y * wi;
        PUT(s->product + i, GET(s->product + i) + (x * wj + y * wk));
    }
    s->product[j] += a[j] * wj + a[j + 1] * wk + SUM(own_j);
    s->product[j + 1] += a[j + 1] * wj + b[j + 1] * wk + SUM(own_k);
}

/// The same of the last column.
static void one_column(double* a, int j, const step_t* s) {
    a[j] -= 2 * s->v[j] * s->p[j];
    s->product[j] += a[j] * s->next[j];
}

/// Column k, brought up to date, as a reflector in `next`; @return tau, 0: nothing to reflect
static double reflector(int n, double* column, int k, const step_t* s, double* next, double* beside) {
    double rest = 0;
    for (int i = k; i < n; ++i) column[i] -= s->v[i] * s->p[k] + s->p[i] * s->v[k];
    for (int i = k + 2; i < n; ++i) rest += column[i] * column[i];
    const double head = *beside = column[k + 1];
    memset(next, 0, (size_t)(k + 1) * sizeof *next);
    next[k + 1] = 1;
    if (!(rest > 0)) {
        for (int i = k + 2; i < n; ++i) next[i] = 0;
        return 0;
    }
    *beside = -copysign(sqrt(head * head + rest), head);
    for (int i = k + 2; i < n; ++i) next[i] = column[i] /= head - *beside;
    return (*beside - head) / *beside;
}

okid_reduce_fn REDUCE;
void REDUCE(int n, double* a, double* d, double* e, double* tau, double* spare) {
    const size_t length = (size_t)n + PAD;
    double *v = spare, *p = v + length, *next = p + length, *product = next + length;
    for (int k = 0; k + 1 < n; ++k) {
        double* column = a + (size_t)k * length;
        const step_t s = {v, p, next, product};
        tau[k] = reflector(n, column, k, &s, next, e + k);
        d[k] = column[k];
        memset(product, 0, length * sizeof *product);
        int j = k + 1;
        for (; j + 1 < n; j += 2) two_columns(n, a + (size_t)j * length, a + (size_t)(j + 1) * length, j, &s);
        if (j < n) one_column(a + (size_t)j * length, j, &s);
        double along = 0;
        for (int i = k + 1; i < n; ++i) along += product[i] * next[i];
        along *= tau[k] / 2;
        for (int i = k + 1; i < n; ++i) product[i] = tau[k] * (product[i] - along * next[i]);
        double* swap = v;
        v = next, next = swap;
        swap = p;
        p = product, product = swap;
    }
    d[n - 1] = a[(size_t)(n - 1) * (length + 1)];
}

okid_reflect_fn REFLECT;
void REFLECT(int n, const double* a, const double* tau, int count, double* columns) {
    for (int r = n - 2; r >= 0; --r) {
        const double* v = a + (size_t)r * ((size_t)n + PAD);
        for (int j = 0; tau[r] != 0 && j < count; ++j) {
            double* x = columns + (size_t)j * (size_t)n;
            lanes_t sums = {0};
            int i = r + 2;
            for (; i + PAD <= n; i += PAD) sums += GET(v + i) * GET(x + i);
            double along = x[r + 1] + SUM(sums);
            for (int k = i; k < n; ++k) along += v[k] * x[k];
            along *= tau[r];
            x[r + 1] -= along;
            for (i = r + 2; i + PAD <= n; i += PAD) PUT(x + i, GET(x + i) - along * GET(v + i));
            for (; i < n; ++i) x[i] -= along * v[i];
        }
    }
}

#ifdef OKID_KERNEL_IS_BASE
okid_tridiagonal_t okid_tridiagonal_pick(void) {
#ifdef OKID_KERNEL_DISPATCH
    extern okid_reduce_fn okid_reduce_avx2, okid_reduce_avx512;
    extern okid_reflect_fn okid_reflect_avx2, okid_reflect_avx512;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return (okid_tridiagonal_t){okid_reduce_avx512, okid_reflect_avx512};
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return (okid_tridiagonal_t){okid_reduce_avx2, okid_reflect_avx2};
#endif
    return (okid_tridiagonal_t){okid_reduce_base, okid_reflect_base};
}
#endif
