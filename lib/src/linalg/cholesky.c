// SPDX-License-Identifier: MIT
// PURPOSE    Cholesky factor of a matrix of some ten to some hundred rows, one source for every instruction set
// METHOD     left-looking, four columns at a time: what the columns before take from them stays in registers for three vectors of
//            rows, then the four are solved side by side. Vectors end with the last row; the first one may begin above the
//            diagonal, and what it holds there is not stored
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 4.2.5
// NUMERICS   backward stable, as LAPACK's
// WORKSPACE  none; n^3 / 3 flop
#include "cholesky.h"
#include "accumulate/isa.h"

#include <math.h>

#define CHOLESKY OKID_FOR_ISA(okid_cholesky_)

#if defined(__AVX512F__)
enum { LANES = 8 };
#elif defined(__AVX2__)
enum { LANES = 4 };
#else
enum { LANES = 2 };
#endif
enum { COLUMNS = 4, VECTORS = 3 };
typedef double lanes_t __attribute__((vector_size(LANES * sizeof(double)), aligned(8)));
#define GET(p) (*(const lanes_t*)(p))
#define PUT(p, v) (*(lanes_t*)(p) = (v))

/// Four columns less what the columns before take, `vectors` vectors of rows from i on; `above`: so many rows of the first stand
/// above row j.
static inline __attribute__((always_inline)) void strip(double* a, size_t ld, int j, int i, int above,
                                                        const int vectors) {
    lanes_t sums[COLUMNS][VECTORS];
    double* to = a + (size_t)j * ld + i;
#pragma GCC unroll 4
    for (int c = 0; c < COLUMNS; ++c)
#pragma GCC unroll 3
        for (int v = 0; v < vectors; ++v) sums[c][v] = GET(to + (size_t)c * ld + v * LANES);
    const double *rows = a + i, *top = a + j;
    for (int k = 0; k < j; ++k, rows += ld, top += ld) {
#pragma GCC unroll 4
        for (int c = 0; c < COLUMNS; ++c)
#pragma GCC unroll 3
            for (int v = 0; v < vectors; ++v) sums[c][v] -= GET(rows + v * LANES) * top[c];
    }
#pragma GCC unroll 4
    for (int c = 0; c < COLUMNS; ++c) {
        const int hidden = above + (i + above == j ? c : 0); // rows above the diagonal
        double* own = to + (size_t)c * ld;
#pragma GCC unroll 3
        for (int v = 0; v < vectors; ++v) {
            if (v * LANES >= hidden)
                PUT(own + v * LANES, sums[c][v]);
            else
                for (int r = hidden - v * LANES; r < LANES; ++r) own[v * LANES + r] = sums[c][v][r];
        }
    }
}

static void four_columns(int n, double* a, size_t ld, int j) {
    const int first = n - (n - j + LANES - 1) / LANES * LANES;
    for (int i = first; i < n; i += VECTORS * LANES) {
        const int above = i == first ? j - first : 0;
        switch ((n - i) / LANES) {
        case 1: strip(a, ld, j, i, above, 1); break;
        case 2: strip(a, ld, j, i, above, 2); break;
        default: strip(a, ld, j, i, above, VECTORS); break;
        }
    }
}

/// Columns j .. j + count - 1 of the factor, from what the columns before `taken` have left of them.
/// @return 0, or 1 + the column without a positive pivot
static int solve_columns(int n, double* a, size_t ld, int taken, int j, int count) {
    for (int c = j; c < j + count; ++c) {
        double* column = a + (size_t)c * ld;
        for (int k = taken; k < c; ++k) {
            const double *before = a + (size_t)k * ld, by = before[c];
            for (int i = c; i < n; ++i) column[i] -= before[i] * by;
        }
        if (!(column[c] > 0) || !isfinite(column[c])) return c + 1;
        column[c] = sqrt(column[c]);
        const double over = 1 / column[c];
        for (int i = c + 1; i < n; ++i) column[i] *= over;
    }
    return 0;
}

okid_cholesky_fn CHOLESKY;
int CHOLESKY(int n, double* a, size_t ld) {
    for (int j = 0; j < n; j += COLUMNS) {
        const int count = n - j < COLUMNS ? n - j : COLUMNS;
        const int in_vectors = count == COLUMNS && j >= LANES; // else they would begin before the first row
        if (in_vectors) four_columns(n, a, ld, j);
        const int bad = solve_columns(n, a, ld, in_vectors ? j : 0, j, count);
        if (bad) return bad;
    }
    return 0;
}

#ifdef OKID_KERNEL_IS_BASE
okid_cholesky_fn* okid_cholesky_pick(int n) {
    enum { MOST = 640, MOST_BASE = 100 };
    if (n > MOST) return NULL;
#ifdef OKID_KERNEL_DISPATCH
    extern okid_cholesky_fn okid_cholesky_avx2, okid_cholesky_avx512;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return okid_cholesky_avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return okid_cholesky_avx2;
#endif
    return n > MOST_BASE ? NULL : okid_cholesky_base;
}
#endif
