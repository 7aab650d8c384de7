// SPDX-License-Identifier: MIT
// PURPOSE    append rows to a triangular factor by Householder reflectors, one source for every instruction set
// METHOD     [R; W]: a reflector of column j touches row j of R and all of W. GROUP reflectors are made from a copy of their
//            columns of W, then applied together to a register tile of columns: Y = R_g + V^T W, forward substitution with
//            V^T V in the place of the triangle of the compact WY form, R_g -= X, W -= V X. Rows lie in memory, so that
//            lanes hold neighbouring columns and no sum crosses lanes
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 5.1, 5.2, 6.5; Schreiber, Van Loan (1989) for compact WY
// NUMERICS   backward stable; the diagonal keeps its sign (Parlett's formula), which rounds R up to ten times less than the usual
//            choice when few rows meet a large R; squares must neither overflow nor vanish (the callers bound the numbers)
// WORKSPACE  the caller's panel, stack < 3 KiB; 2 columns^2 flop a row
#include "householder.h"
#include "isa.h"

#include <float.h>
#include <string.h>
#include <tgmath.h>

#define OKID_HOUSEHOLDER OKID_FOR_ISA(okid_householder_)

#if defined(__AVX512F__)
enum { LANES = 8, COLS = 3, GROUP = 8 };
#elif defined(__AVX2__)
enum { LANES = 4, COLS = 3, GROUP = 4 };
#else // 16 bytes; floats are for processors with 32 scalar registers
enum { LANES = 16 / sizeof(okid_real_t), COLS = LANES == 2 ? 2 : 1, GROUP = 4 };
#endif
enum { TILE = LANES * COLS, STEP = 4 };

typedef okid_real_t real;
typedef real lanes_t __attribute__((vector_size(LANES * sizeof(real))));
typedef real group_t __attribute__((vector_size(GROUP * sizeof(real))));

// Columns below this part of the diagonal change nothing, and their reflector could overflow.
static const real negligible = sizeof(real) == sizeof(float) ? (real)FLT_EPSILON : (real)DBL_EPSILON;

#define INLINE static inline __attribute__((always_inline))

INLINE lanes_t load(const real* p) {
    lanes_t v;
    memcpy(&v, p, sizeof v);
    return v;
}

INLINE void store(real* p, lanes_t v) { memcpy(p, &v, sizeof v); }

/// GROUP reflectors I - tau v v^T, v = [e_g; V(:, g)], and the inner products of their lower parts.
typedef struct reflectors_t {
    real tau[GROUP], dot[GROUP][GROUP];
} reflectors_t;

/// One column becomes a reflector, the later columns of the panel are reflected. `sums` holds V(:, g)^T V on entry, the
/// same for g + 1 on return. The diagonal keeps its sign: R moves by little, and so does what rounding adds.
INLINE real reflect(real* r, real* v, int32_t count, const int g, group_t* sums) {
    const real alpha = r[g], rest = (*sums)[g], least = negligible * alpha;
    real tau = 0, scale = 0;
    group_t away = {0};
    if (rest > least * least) {
        const real beta = copysign(sqrt(alpha * alpha + rest), alpha), sum = alpha + beta;
        scale = -sum / rest; // 1 / (alpha - beta)
        tau = rest / (beta * sum);
        r[g] = beta;
        for (int c = g + 1; c < GROUP; ++c) {
            const real x = tau * (r[c] + scale * (*sums)[c]);
            r[c] -= x;
            away[c] = -scale * x;
        }
    }
    const int next = g + 1 < GROUP ? g + 1 : g;
    group_t part[STEP];
    memset(part, 0, sizeof part);
    for (int32_t n = 0; n < count; n += STEP, v += STEP * GROUP) {
#pragma GCC unroll 4
        for (int k = 0; k < STEP; ++k) {
            group_t row;
            memcpy(&row, v + k * GROUP, sizeof row);
            const real x = row[g];
            row += x * away;
            row[g] = x * scale;
            memcpy(v + k * GROUP, &row, sizeof row);
            part[k] += row[next] * row;
        }
    }
    *sums = (part[0] + part[1]) + (part[2] + part[3]);
    return tau;
}

/// Reflectors of the GROUP columns whose diagonal block of R stands at r.
INLINE void make_reflectors(real* r, size_t stride, real* v, int32_t count, reflectors_t* h) {
    group_t part[STEP], product[GROUP];
    memset(part, 0, sizeof part);
    for (int32_t n = 0; n < count; n += STEP) {
#pragma GCC unroll 4
        for (int k = 0; k < STEP; ++k) {
            group_t row;
            memcpy(&row, v + (n + k) * GROUP, sizeof row);
            part[k] += row[0] * row;
        }
    }
    group_t sums = (part[0] + part[1]) + (part[2] + part[3]);
#pragma GCC unroll 8
    for (int g = 0; g < GROUP; ++g) h->tau[g] = reflect(r + (size_t)g * stride, v, count, g, &sums);
    memset(product, 0, sizeof product);
    for (int32_t n = 0; n < count; ++n) {
        group_t row;
        memcpy(&row, v + n * GROUP, sizeof row);
#pragma GCC unroll 8
        for (int g = 0; g < GROUP; ++g) product[g] += row[g] * row;
    }
    memcpy(h->dot, product, sizeof product);
}

/// Apply the reflectors to cols * LANES columns of R (at r) and W (at w).
INLINE void tile(real* r, size_t r_stride, real* w, size_t w_stride, const real* v, int32_t count,
                 const reflectors_t* h, const int cols) {
    lanes_t x[GROUP][COLS];
#pragma GCC unroll 8
    for (int g = 0; g < GROUP; ++g) {
#pragma GCC unroll 8
        for (int k = 0; k < cols; ++k) x[g][k] = load(r + (size_t)g * r_stride + k * LANES);
    }
    real* row = w;
    for (int32_t n = 0; n < count; ++n, row += w_stride) {
#pragma GCC unroll 8
        for (int k = 0; k < cols; ++k) {
            const lanes_t y = load(row + k * LANES);
#pragma GCC unroll 8
            for (int g = 0; g < GROUP; ++g) x[g][k] += v[n * GROUP + g] * y;
        }
    }
#pragma GCC unroll 8
    for (int g = 0; g < GROUP; ++g) {
#pragma GCC unroll 8
        for (int k = 0; k < cols; ++k) {
            lanes_t y = x[g][k];
#pragma GCC unroll 8
            for (int i = 0; i < g; ++i) y -= h->dot[g][i] * x[i][k];
            y *= h->tau[g];
            x[g][k] = y;
            real* to = r + (size_t)g * r_stride + k * LANES;
            store(to, load(to) - y);
        }
    }
    row = w;
    for (int32_t n = 0; n < count; ++n, row += w_stride) {
#pragma GCC unroll 8
        for (int k = 0; k < cols; ++k) {
            lanes_t y = load(row + k * LANES);
#pragma GCC unroll 8
            for (int g = 0; g < GROUP; ++g) y -= v[n * GROUP + g] * x[g][k];
            store(row + k * LANES, y);
        }
    }
}

okid_householder_fn OKID_HOUSEHOLDER;
void OKID_HOUSEHOLDER(real* triangle, size_t stride, real* rows, int32_t count, size_t first, real* panel) {
    const int32_t padded = (count + STEP - 1) / STEP * STEP;
    memset(panel + (size_t)count * GROUP, 0, (size_t)(padded - count) * GROUP * sizeof(real));
    for (size_t j = first; j < stride; j += GROUP) {
        const size_t width = stride - j / OKID_PANEL * OKID_PANEL; // length of the rows of this strip
        real *r = triangle + okid_triangle_row(stride, j) + j, *w = rows + j;
        for (int32_t n = 0; n < count; ++n) memcpy(panel + n * GROUP, w + (size_t)n * stride, GROUP * sizeof(real));
        reflectors_t h;
        make_reflectors(r, width, panel, padded, &h);
        size_t c = GROUP;
        for (; j + c + TILE <= stride; c += TILE) tile(r + c, width, w + c, stride, panel, count, &h, COLS);
        for (; j + c < stride; c += LANES) tile(r + c, width, w + c, stride, panel, count, &h, 1);
    }
}

#ifdef OKID_KERNEL_IS_BASE
okid_householder_fn* okid_householder_pick(void) {
#ifdef OKID_KERNEL_DISPATCH
    extern okid_householder_fn okid_householder_avx2, okid_householder_avx512; // compiled for double
    if (sizeof(real) != sizeof(double)) return okid_householder_base;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return okid_householder_avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return okid_householder_avx2;
#endif
    return okid_householder_base;
}
#endif
