// SPDX-License-Identifier: MIT
// The per-sample kernels of every instruction set this processor has, not only the fastest: sums of products over the
// lag window, direct and by FFT, against a plain loop in 64-bit integers; filters of modes against a plain
// recursion, Cholesky factors against the matrix they are of.
#include "accumulate/kernel.h"
#include "accumulate/spectrum.h"
#include "linalg/cholesky.h"
#include "mechanics/recursion.h"
#include "modal_rig.h"

#include <complex.h>
#include <stdio.h>
#include <stdlib.h>
#include <unity.h>

okid_kernel_fn okid_kernel_base;
okid_kernel_fn okid_kernel_avx2 __attribute__((weak)),
    okid_kernel_avx512 __attribute__((weak)); // not on every processor
okid_spectrum_absorb_fn okid_spectrum_absorb_base;
okid_spectrum_flush_fn okid_spectrum_flush_base;
okid_spectrum_absorb_fn okid_spectrum_absorb_avx2 __attribute__((weak)),
    okid_spectrum_absorb_avx512 __attribute__((weak));
okid_spectrum_flush_fn okid_spectrum_flush_avx2 __attribute__((weak)), okid_spectrum_flush_avx512 __attribute__((weak));

okid_filters_fn okid_filters_base;
okid_filters_fn okid_filters_avx2 __attribute__((weak)), okid_filters_avx512 __attribute__((weak));

okid_cholesky_fn okid_cholesky_base __attribute__((weak)); // not on every linear-algebra backend
okid_cholesky_fn okid_cholesky_avx2 __attribute__((weak)), okid_cholesky_avx512 __attribute__((weak));

typedef struct kernels_t {
    const char* name;
    okid_cholesky_fn* cholesky;
    okid_filters_fn* filters;
    okid_kernel_fn* direct;
    okid_spectrum_absorb_fn* absorb;
    okid_spectrum_flush_fn* flush;
} kernels_t;

static kernels_t kernels[3];
static int count_of_kernels;

static void add(const char* name, okid_cholesky_fn* cholesky, okid_filters_fn* filters, okid_kernel_fn* direct,
                okid_spectrum_absorb_fn* absorb, okid_spectrum_flush_fn* flush) {
    if (direct) kernels[count_of_kernels++] = (kernels_t){name, cholesky, filters, direct, absorb, flush};
}

static void find_kernels(void) {
    add("base", okid_cholesky_base, okid_filters_base, okid_kernel_base, okid_spectrum_absorb_base,
        okid_spectrum_flush_base);
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        add("avx2", okid_cholesky_avx2, okid_filters_avx2, okid_kernel_avx2, okid_spectrum_absorb_avx2,
            okid_spectrum_flush_avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        add("avx512", okid_cholesky_avx512, okid_filters_avx512, okid_kernel_avx512, okid_spectrum_absorb_avx512,
            okid_spectrum_flush_avx512);
#endif
}

void setUp(void) {}
void tearDown(void) {}

static int16_t* random_codes(size_t count, uint64_t seed) {
    int16_t* codes = malloc(count * sizeof *codes);
    for (size_t i = 0; i < count; ++i) codes[i] = (int16_t)lrint(fmax(-32768, fmin(32767, 9000 * rig_normal(&seed))));
    return codes;
}

/// S(r, c) = sum_n x[(n + p) m + r] x[n m + c], of the first w channels for c < w (p + 1).
static int64_t plain(const int16_t* x, int m, int w, int p, int count, int r, int c) {
    int64_t sum = 0;
    for (int n = 0; n < count; ++n) sum += (int64_t)x[(n + p) * m + r] * x[(n + c / w) * m + c % w];
    return sum;
}

static void expect_sums(const char* name, const double* sums, const int16_t* codes, int m, int w, int p, int count) {
    char what[80];
    for (int r = 0; r < m; ++r)
        for (int c = 0; c < w * (p + 1); ++c) {
            snprintf(what, sizeof what, "%s, m %d, w %d, p %d, count %d, (%d, %d)", name, m, w, p, count, r, c);
            TEST_ASSERT_EQUAL_INT64_MESSAGE(plain(codes, m, w, p, count, r, c), (int64_t)sums[r * w * (p + 1) + c],
                                            what);
        }
}

/// One kernel on m channels, the first w of them lagged; in one call and in two.
static void check_direct(kernels_t kernel, const int16_t* codes, int m, int w, int p) {
    enum { MOST = 11, COUNT = 37, FIRST = 20 };
    static double x[MOST * (MOST + COUNT)], lagged[MOST * (MOST + COUNT)], sums[MOST * MOST * MOST];
    for (int i = 0; i < m * (p + COUNT); ++i) x[i] = codes[i];
    for (int n = 0; n < p + COUNT; ++n)
        for (int c = 0; c < w; ++c) lagged[n * w + c] = codes[n * m + c];
    memset(sums, 0, sizeof sums);
    kernel.direct(sums, x + p * m, lagged, m, w, p, FIRST, p + FIRST);
    kernel.direct(sums, x + (p + FIRST) * m, lagged + FIRST * w, m, w, p, COUNT - FIRST, p + COUNT - FIRST);
    expect_sums(kernel.name, sums, codes, m, w, p, COUNT);
    static double short_of[MOST * MOST * MOST];
    for (int held = 0; held <= p + COUNT; held += 7) { // zeros behind `held` are passed over or not: the same sums
        for (int i = 0; i < w * (p + COUNT); ++i) lagged[i] = i < w * held ? codes[i] : 0;
        memset(sums, 0, sizeof sums);
        memset(short_of, 0, sizeof short_of);
        kernel.direct(sums, x + p * m, lagged, m, w, p, COUNT, p + COUNT);
        kernel.direct(short_of, x + p * m, lagged, m, w, p, COUNT, held);
        TEST_ASSERT_EQUAL_MEMORY(sums, short_of, sizeof sums);
    }
}

/// Every remainder of channels and window widths against the tiles of each kernel.
static void direct_sums_are_exact(void) {
    enum { MOST_M = 11, MOST_P = 9, COUNT = 37 };
    int16_t* codes = random_codes(MOST_M * (MOST_P + COUNT), 5);
    for (int m = 1; m <= MOST_M; ++m)
        for (int p = 0; p <= MOST_P; p += p < 3 ? 1 : 3)
            for (int k = 0; k < count_of_kernels; ++k)
                for (int w = 1; w <= m; w += w < 3 || w == m ? 1 : m - w) check_direct(kernels[k], codes, m, w, p);
    free(codes);
}

/// `count` samples in one call, as codes and as numbers, by every kernel.
static void check_fft(int m, int p, const spectrum_plan_t* plan, int count) {
    int16_t* codes = random_codes((size_t)(m * (p + count)), 7 + (uint64_t)(m + count));
    double *memory = malloc(okid_spectrum_doubles(plan) * sizeof *memory),
           *numbers = malloc((size_t)(m * (p + count)) * sizeof *numbers),
           *sums = malloc((size_t)(m * m * (p + 1)) * sizeof *sums);
    for (int i = 0; i < m * (p + count); ++i) numbers[i] = codes[i];
    for (int k = 0; k < count_of_kernels; ++k) {
        memset(memory, 0, okid_spectrum_doubles(plan) * sizeof *memory);
        okid_spectrum_create(plan, memory);
        kernels[k].absorb(plan, memory, numbers, codes + m * p, NULL, count);
        const double energy = okid_spectrum_energy(m, codes + m * p, count);
        TEST_ASSERT_TRUE(energy > 0 && okid_spectrum_error(plan, energy) < 0.5);
        kernels[k].flush(plan, memory, sums, 1);
        expect_sums(kernels[k].name, sums, codes, m, m, p, count);
        kernels[k].absorb(plan, memory, numbers, NULL, numbers + m * p, count);
        memset(sums, 0, (size_t)(m * m * (p + 1)) * sizeof *sums);
        kernels[k].flush(plan, memory, sums, 0); // added, not rounded
        for (int i = 0; i < m * m * (p + 1); ++i) {
            TEST_ASSERT_TRUE_MESSAGE(fabs(sums[i] - nearbyint(sums[i])) < 6.5e-15 * energy, kernels[k].name);
            sums[i] = nearbyint(sums[i]);
        }
        expect_sums(kernels[k].name, sums, codes, m, m, p, count);
    }
    free(numbers);
    free(sums);
    free(memory);
    free(codes);
}

/// One and two windows side by side in the lanes, one to three groups of channels; whole windows, cut ones, fewer than p.
static void sums_by_fft_are_exact(void) {
    const int shapes[][2] = {{1, 40}, {3, 20}, {4, 30}, {6, 15}, {8, 33}, {9, 40}, {17, 18}};
    for (size_t s = 0; s < sizeof shapes / sizeof *shapes; ++s) {
        const int m = shapes[s][0], p = shapes[s][1];
        const spectrum_plan_t plan = okid_spectrum_plan(m, p);
        const int counts[] = {spectrum_samples(&plan), 3 * plan.length + 1, 2 * plan.length - p / 2, p / 2};
        for (size_t k = 0; k < sizeof counts / sizeof *counts; ++k) check_fft(m, p, &plan, counts[k]);
    }
}

/// Filters of `modes` modes in stretches against a recursion sample by sample; of the last mode w^t is left out.
static void check_filters(kernels_t kernel, int n_u, int m, int modes, int count) {
    enum { MOST_M = 13, MOST_MODES = 7, MOST_COUNT = 300, MOST_U = 4 };
    static double v[MOST_M * MOST_COUNT];
    uint64_t seed = (uint64_t)(1000 * n_u + 100 * m + 10 * modes + count);
    for (int i = 0; i < m * count; ++i) v[i] = rig_normal(&seed);
    const size_t K = okid_filters_padded((size_t)modes), M = okid_filters_padded((size_t)m), groups = (size_t)n_u + 1;
    double powers[16 * MOST_MODES * (OKID_FILTERS_BLOCK + 1)] = {0}, state[16 * (MOST_U + 1)] = {0},
                                                          sums[32 * MOST_MODES * (MOST_U + 1)] = {0},
                                                          lags[16 * OKID_FILTERS_BLOCK * MOST_U] = {0};
    double complex w[MOST_MODES], z[MOST_U + 1][MOST_MODES] = {{0}}, want[MOST_U + 1][MOST_MODES][MOST_M] = {{{0}}};
    for (int k = 0; k < modes; ++k) {
        w[k] = (0.999 - 0.01 * k) * cexp(0.3 * I * (k + 1));
        for (size_t j = 0; j <= OKID_FILTERS_BLOCK; ++j) {
            powers[okid_filters_power((size_t)k, j)] = creal(cpow(w[k], (double)j));
            powers[okid_filters_power((size_t)k, j) + 4] = cimag(cpow(w[k], (double)j));
        }
        z[n_u][k] = state[(size_t)n_u * 2 * K + (size_t)k] = 1;
    }
    double* work = malloc(okid_filters_work((size_t)n_u, (size_t)modes) * sizeof *work);
    const okid_filters_t filters = {(size_t)n_u, (size_t)m, (size_t)modes, (size_t)(modes - 1), powers, state,
                                    sums,        lags,      work};
    for (int n = 0; n < count; n += OKID_FILTERS_STRETCH) {
        const int some = count - n < OKID_FILTERS_STRETCH ? count - n : OKID_FILTERS_STRETCH;
        kernel.filters(&filters, v + m * n, (size_t)some);
    }
    for (int n = 0; n < count; ++n)
        for (int g = 0; g <= n_u; ++g)
            for (int k = 0; k < modes; ++k) {
                for (int c = 0; c < m; ++c) want[g][k][c] += z[g][k] * v[m * n + c];
                z[g][k] = w[k] * z[g][k] + (g < n_u ? v[m * n + g] : 0);
            }
    char what[80];
    snprintf(what, sizeof what, "%s: %d inputs of %d channels, %d modes, %d rows", kernel.name, n_u, m, modes, count);
    for (size_t g = 0; g < groups; ++g)
        for (size_t k = 0; k < (size_t)modes; ++k) {
            const double complex end = state[g * 2 * K + k] + I * state[g * 2 * K + K + k];
            TEST_ASSERT_TRUE_MESSAGE(cabs(end - z[g][k]) < 1e-10, what);
            for (size_t c = 0; c < (size_t)m; ++c) {
                const double* at = sums + (g * (size_t)modes + k) * 2 * M + c;
                double complex got = at[0] + I * at[M];
                for (size_t d = 1; g < (size_t)n_u && d < OKID_FILTERS_BLOCK; ++d)
                    got += cpow(w[k], (double)d - 1) * lags[(g * OKID_FILTERS_BLOCK + d) * M + c];
                const int left_out = g == (size_t)n_u && k + 1 == (size_t)modes;
                TEST_ASSERT_TRUE_MESSAGE(cabs(got - (left_out ? 0 : want[g][k][c])) < 1e-9, what);
            }
        }
    free(work);
}

static void filters_are_those_of_a_recursion(void) {
    const int counts[] = {1, 7, 8, 127, 128, 129, 300};
    for (int k = 0; k < count_of_kernels; ++k)
        for (int n_u = 0; n_u <= 4; ++n_u)
            for (int m = n_u + 1; m <= 13; ++m)
                for (int modes = 1; modes <= 7; ++modes)
                    check_filters(kernels[k], n_u, m, modes, counts[(n_u + m + modes) % 7]);
}

/// The factor of a random matrix with a leading dimension of its own, what stands above the diagonal being no number; then the
/// same with a number below zero on the diagonal: no positive pivot.
static void check_cholesky(kernels_t kernel, int n, int ld) {
    enum { MOST = 100 };
    static double random[MOST * MOST], a[MOST * MOST], l[MOST * MOST];
    uint64_t seed = (uint64_t)n;
    for (int i = 0; i < n * n; ++i) random[i] = rig_normal(&seed);
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < ld; ++r) {
            double sum = r == c ? 0.01 * n : 0;
            for (int k = 0; r < n && k < n; ++k) sum += random[r * n + k] * random[c * n + k];
            l[c * ld + r] = a[c * ld + r] = r >= c && r < n ? sum : NAN;
        }
    char what[60];
    snprintf(what, sizeof what, "%s: %d rows of %d", kernel.name, n, ld);
    TEST_ASSERT_EQUAL_MESSAGE(0, kernel.cholesky(n, l, (size_t)ld), what);
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < ld; ++r) {
            double sum = 0;
            for (int k = 0; k <= c && r < n; ++k) sum += l[k * ld + r] * l[k * ld + c];
            const int below = r >= c && r < n;
            TEST_ASSERT_TRUE_MESSAGE(below ? fabs(sum - a[c * ld + r]) < 1e-13 * n * n : isnan(l[c * ld + r]), what);
        }
    a[n / 2 * ld + n / 2] = -1;
    TEST_ASSERT_EQUAL_MESSAGE(n / 2 + 1, kernel.cholesky(n, a, (size_t)ld), what);
}

static void factors_are_those_of_the_matrix(void) {
    for (int k = 0; k < count_of_kernels; ++k)
        for (int n = 1; n <= 97 && kernels[k].cholesky; n += n < 40 ? 1 : 19)
            for (int beyond = 0; beyond < 4; beyond += 3) check_cholesky(kernels[k], n, n + beyond);
}

int main(void) {
    find_kernels();
    UNITY_BEGIN();
    RUN_TEST(direct_sums_are_exact);
    RUN_TEST(sums_by_fft_are_exact);
    RUN_TEST(filters_are_those_of_a_recursion);
    RUN_TEST(factors_are_those_of_the_matrix);
    return UNITY_END();
}
