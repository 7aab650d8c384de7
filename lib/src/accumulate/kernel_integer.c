// SPDX-License-Identifier: MIT
// PURPOSE    the inner loop for codes on processors without double arithmetic: products of 32 bits into sums of 64
// METHOD     the compiler makes one multiply-accumulate (SMLAL on Arm) of each product; the usual numbers of channels are
//            compiled with that number known, so that the loops over channels unroll
// NUMERICS   exact; the caller folds the sums before they could leave 64 bits
// WORKSPACE  none; m^2 (p+1) multiply-accumulates a sample
#include "kernel.h"
#include "wide.h"

#include <stddef.h>

static inline __attribute__((always_inline)) void absorb(int64_t* S, const int64_t* x, const int m, int p, int count) {
    const int width = m * (p + 1);
    for (int n = 0; n < count; ++n, x += m) {
        const int64_t* now = x + (size_t)p * (size_t)m;
        for (int r = 0; r < m; ++r) {
            const int32_t v = (int32_t)now[r];
            int64_t* sum = S + (size_t)r * (size_t)width;
            const int64_t* window = x;
            for (int lag = 0; lag <= p; ++lag, sum += m, window += m)
                for (int c = 0; c < m; ++c) sum[c] += (int64_t)v * (int32_t)window[c];
        }
    }
}

/// 32-bit codes: two full-scale products already fill 64 bits.
static void absorb_wide(int64_t* low, int64_t* high, const int64_t* x, int m, int p, int count) {
    const int width = m * (p + 1);
    for (int n = 0; n < count; ++n, x += m)
        for (int r = 0; r < m; ++r) {
            const int64_t v = x[p * m + r];
            for (int c = 0; c < width; ++c) wide_add(high + r * width + c, low + r * width + c, v * x[c]);
        }
}

void okid_kernel_integer(int64_t* low, int64_t* high, const int64_t* x, int m, int p, int count) {
    if (high) {
        absorb_wide(low, high, x, m, p, count);
        return;
    }
    switch (m) {
    case 2: absorb(low, x, 2, p, count); break;
    case 3: absorb(low, x, 3, p, count); break;
    case 4: absorb(low, x, 4, p, count); break;
    case 6: absorb(low, x, 6, p, count); break;
    case 8: absorb(low, x, 8, p, count); break;
    default: absorb(low, x, m, p, count); break;
    }
}
