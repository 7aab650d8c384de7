// SPDX-License-Identifier: MIT
// PURPOSE    the inner loop for codes on processors without double arithmetic: products of 32 bits into sums of 64
// METHOD     the compiler makes one multiply-accumulate (SMLAL on Arm) of each product; tiles of 2 x 2 sums stay in registers
//            over all samples of the call, so that four products cost four loads: as many as 13 registers hold
// NUMERICS   exact; the caller folds the sums before they could leave 64 bits
// WORKSPACE  none; m w (p+1) multiply-accumulates a sample
#include "kernel.h"
#include "wide.h"

#include <stddef.h>

enum { TILE = 2 };

/// S[r][c] += sum over samples of now[r] window[c], r < rows, c < cols.
static inline __attribute__((always_inline)) void tile(int64_t* S, int ld, const int64_t* now, const int64_t* window,
                                                       int m, int w, int count, const int rows, const int cols) {
    int64_t sum[TILE][TILE];
#pragma GCC unroll 2
    for (int r = 0; r < rows; ++r)
#pragma GCC unroll 2
        for (int c = 0; c < cols; ++c) sum[r][c] = S[r * ld + c];
#pragma GCC unroll 2
    for (int n = 0; n < count; ++n, now += m, window += w)
#pragma GCC unroll 2
        for (int r = 0; r < rows; ++r)
#pragma GCC unroll 2
            for (int c = 0; c < cols; ++c) sum[r][c] += (int64_t)(int32_t)now[r] * (int32_t)window[c];
#pragma GCC unroll 2
    for (int r = 0; r < rows; ++r)
#pragma GCC unroll 2
        for (int c = 0; c < cols; ++c) S[r * ld + c] = sum[r][c];
}

static void absorb(int64_t* S, const int64_t* now, const int64_t* x, int m, int w, int p, int count) {
    const int width = w * (p + 1);
    for (int r = 0; r < m; r += TILE) {
        int64_t* sum = S + (size_t)r * (size_t)width;
        int c = 0;
        if (r + 1 < m) {
            for (; c + 1 < width; c += TILE) tile(sum + c, width, now + r, x + c, m, w, count, TILE, TILE);
            if (c < width) tile(sum + c, width, now + r, x + c, m, w, count, TILE, 1);
        } else {
            for (; c + 1 < width; c += TILE) tile(sum + c, width, now + r, x + c, m, w, count, 1, TILE);
            if (c < width) tile(sum + c, width, now + r, x + c, m, w, count, 1, 1);
        }
    }
}

/// 32-bit codes: two full-scale products already fill 64 bits.
static void absorb_wide(int64_t* low, int64_t* high, const int64_t* now, const int64_t* x, int m, int w, int p,
                        int count) {
    const int width = w * (p + 1);
    for (int n = 0; n < count; ++n, now += m, x += w)
        for (int r = 0; r < m; ++r) {
            const int64_t v = now[r];
            for (int c = 0; c < width; ++c) wide_add(high + r * width + c, low + r * width + c, v * x[c]);
        }
}

void okid_kernel_integer(int64_t* low, int64_t* high, const int64_t* current, const int64_t* window, int m, int w,
                         int p, int count) {
    if (high)
        absorb_wide(low, high, current, window, m, w, p, count);
    else
        absorb(low, current, window, m, w, p, count);
}
