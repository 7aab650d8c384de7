// SPDX-License-Identifier: MIT
// The row update of a triangular factor, by every instruction set this processor has: R^T R + W^T W is kept.
#include "accumulate/householder.h"
#include "modal_rig.h"

#include <float.h>
#include <unity.h>

enum { MOST = 90, ROWS = 70, STRIDE = 104 };

okid_householder_fn okid_householder_base;
okid_householder_fn okid_householder_avx2 __attribute__((weak)); // not on every processor, and for double only

static const double eps = sizeof(okid_real_t) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON;
static okid_real_t triangle[STRIDE * (STRIDE + OKID_PANEL) / 2], rows[ROWS * STRIDE], panel[(ROWS + 3) * OKID_PANEL];
static double before[MOST * MOST], after[MOST * MOST], norm[MOST];
static okid_householder_fn* kernel;

void setUp(void) {}
void tearDown(void) {}

static double entry(size_t stride, int i, int j) {
    return j < i ? 0 : (double)triangle[okid_triangle_row(stride, (size_t)i) + (size_t)j];
}

/// out = R^T R + W^T W, W only while `count` > 0.
static void products(size_t stride, int n, int count, double* out) {
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            double sum = 0;
            for (int k = 0; k <= i && k <= j; ++k) sum += entry(stride, k, i) * entry(stride, k, j);
            for (int k = 0; k < count; ++k)
                sum += (double)rows[(size_t)k * stride + (size_t)i] * (double)rows[(size_t)k * stride + (size_t)j];
            out[j * n + i] = sum;
        }
}

/// Random W behind column `first`, scaled column by column, appended to the triangle that stands.
static void append(size_t stride, int n, int count, int first, const double* scale, uint64_t* state) {
    memset(rows, 0, sizeof rows);
    for (int k = 0; k < count; ++k)
        for (int j = first; j < n; ++j)
            rows[(size_t)k * stride + (size_t)j] = (okid_real_t)((scale ? scale[j] : 1) * rig_normal(state));
    products(stride, n, count, before);
    kernel(triangle, stride, rows, count, (size_t)first, panel);
    products(stride, n, 0, after);
    for (int j = 0; j < n; ++j) norm[j] = sqrt(before[j * n + j]);
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
            TEST_ASSERT_DOUBLE_WITHIN(60 * eps * norm[i] * norm[j], before[j * n + i], after[j * n + i]);
}

static void clean(size_t stride) { // nothing left of the diagonal, nothing in the padding
    for (size_t i = 0; i < stride; ++i)
        for (size_t j = i - i % OKID_PANEL; j < i; ++j)
            TEST_ASSERT_TRUE(triangle[okid_triangle_row(stride, i) + j] == 0);
}

static void products_are_kept(void) {
    const int sizes[] = {1, 7, 8, 9, 31, 63, 85, MOST}, counts[] = {1, 2, 3, 4, 5, 32, ROWS};
    uint64_t state = 5;
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s)
        for (size_t c = 0; c < sizeof counts / sizeof *counts; ++c) {
            const size_t stride = okid_triangle_stride((size_t)sizes[s]);
            TEST_ASSERT_TRUE(stride <= STRIDE);
            memset(triangle, 0, sizeof triangle);
            for (int round = 0; round < 4; ++round) append(stride, sizes[s], counts[c], 0, NULL, &state);
            const int last = sizes[s] > 20 ? 16 : 0;
            append(stride, sizes[s], counts[c], last, NULL, &state);
            clean(stride);
        }
}

/// Columns of very different size, zero columns, columns below the rounding of the diagonal, negative diagonals.
static void odd_columns_do_no_harm(void) {
    enum { N = 31 };
    const size_t stride = okid_triangle_stride(N);
    double scale[N];
    uint64_t state = 8;
    for (int j = 0; j < N; ++j) scale[j] = j % 5 == 0 ? 0 : pow(10, j % 7 - 3);
    memset(triangle, 0, sizeof triangle);
    append(stride, N, 40, 0, scale, &state);
    for (int i = 0; i < N; i += 3)
        for (int j = i; j < N; ++j) triangle[okid_triangle_row(stride, (size_t)i) + (size_t)j] *= -1;
    append(stride, N, 40, 0, scale, &state);
    for (int j = 0; j < N; ++j) scale[j] *= j % 2 ? 1e-18 : 1; // squares still above the smallest float
    append(stride, N, 7, 0, scale, &state);
    for (int j = 0; j < N; ++j) scale[j] = 1;
    append(stride, N, 40, 0, scale, &state);
    clean(stride);
}

int main(void) {
    UNITY_BEGIN();
    okid_householder_fn* all[3] = {okid_householder_base, okid_householder_pick(), NULL};
#if defined(__x86_64__)
    const int wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (sizeof(okid_real_t) == sizeof(double) && wide) all[2] = okid_householder_avx2;
#endif
    for (int k = 0; k < 3; ++k) {
        kernel = all[k];
        if (!kernel) continue;
        RUN_TEST(products_are_kept);
        RUN_TEST(odd_columns_do_no_harm);
    }
    return UNITY_END();
}
