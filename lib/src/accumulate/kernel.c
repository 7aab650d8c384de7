// SPDX-License-Identifier: MIT
// PURPOSE    shift-structured Gram update of a run of samples, one source for every instruction set
// METHOD     matrix product without packing: the lag window of a sample is contiguous in memory, so a register tile of
//            OKID_ROWS x OKID_COLS numbers is held over all samples of the run; the last tile overlaps its neighbour
// NUMERICS   plain sums in double in the order of the samples; exact for 16-bit codes up to 2^22 samples
// WORKSPACE  none; 2 m w (p+1) flop a sample
#include "kernel.h"
#include "isa.h"

#include <string.h>

#define OKID_KERNEL OKID_FOR_ISA(okid_kernel_)

#if defined(__AVX512F__)
enum { LANES = 8, COLS = 5, MAX_ROWS = 5 };
#elif defined(__AVX2__)
enum { LANES = 4, COLS = 3, MAX_ROWS = 4 };
#elif defined(__aarch64__)
enum { LANES = 2, COLS = 4, MAX_ROWS = 5 };
#else
enum { LANES = 2, COLS = 2, MAX_ROWS = 4 };
#endif
enum { TILE = LANES * COLS };

typedef double lanes_t __attribute__((vector_size(LANES * sizeof(double))));

static inline lanes_t load(const double* p) {
    lanes_t v;
    memcpy(&v, p, sizeof v);
    return v;
}

/// One tile: `rows` channels from `current` against TILE window entries from `window`; the first `skip` columns belong
/// to the neighbour and are left alone.
static inline __attribute__((always_inline)) void tile(double* S, int ld, const double* current, const double* window,
                                                       int m, int stride, int count, const int rows, int skip) {
    lanes_t acc[MAX_ROWS][COLS];
    for (int r = 0; r < rows; ++r) memcpy(acc[r], S + r * ld, sizeof acc[r]);
    for (int n = 0; n < count; ++n, current += m, window += stride) {
        lanes_t w[COLS];
#pragma GCC unroll 8
        for (int k = 0; k < COLS; ++k) w[k] = load(window + k * LANES);
#pragma GCC unroll 8
        for (int r = 0; r < rows; ++r) {
            const double v = current[r];
#pragma GCC unroll 8
            for (int k = 0; k < COLS; ++k) acc[r][k] += v * w[k];
        }
    }
    double out[TILE];
    for (int r = 0; r < rows; ++r) {
        memcpy(out, acc[r], sizeof out);
        for (int c = skip; c < TILE; ++c) S[r * ld + c] = out[c];
    }
}

static void tiles(double* S, int ld, const double* current, const double* window, int m, int w, int count, int rows,
                  int skip) {
    switch (rows) {
    case 1: tile(S, ld, current, window, m, w, count, 1, skip); break;
    case 2: tile(S, ld, current, window, m, w, count, 2, skip); break;
    case 3: tile(S, ld, current, window, m, w, count, 3, skip); break;
    case 4: tile(S, ld, current, window, m, w, count, 4, skip); break;
    default: tile(S, ld, current, window, m, w, count, MAX_ROWS, skip); break;
    }
}

okid_kernel_fn OKID_KERNEL;
void OKID_KERNEL(double* S, const double* current, const double* window, int m, int w, int p, int count, int held) {
    const int width = w * (p + 1);
    if (width < TILE) { // a handful of numbers: no tile fits
        for (int n = 0; n < count; ++n)
            for (int r = 0; r < m; ++r)
                for (int c = 0; c < width; ++c) S[r * width + c] += current[n * m + r] * window[n * w + c];
        return;
    }
    const int groups = (m + MAX_ROWS - 1) / MAX_ROWS;
    for (int c = 0; c < width; c += TILE) {
        const int start = c + TILE <= width ? c : width - TILE, left = held - start / w;
        if (left <= 0) break;
        for (int g = 0, r = 0; g < groups; ++g) {
            const int rows = (m - r + groups - g - 1) / (groups - g);
            tiles(S + r * width + start, width, current + r, window + start, m, w, left < count ? left : count, rows,
                  c - start);
            r += rows;
        }
    }
}

#ifdef OKID_KERNEL_IS_BASE
okid_kernel_fn* okid_kernel_pick(void) {
#ifdef OKID_KERNEL_DISPATCH
    extern okid_kernel_fn okid_kernel_avx2, okid_kernel_avx512;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return okid_kernel_avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return okid_kernel_avx2;
#endif
    return okid_kernel_base;
}
#endif
