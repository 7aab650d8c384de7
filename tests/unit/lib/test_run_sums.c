// SPDX-License-Identifier: MIT
// okid_accumulator_run(), the Gram matrix and the means of the lag rows beside sums over the samples: every kind of
// samples, growing and in a window, with units and offsets, in an order of lags that is written out.
#include "accumulate/lag_means.h"

#include <math.h>
#include <okid/accumulator.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { M = 3, LAGS = 4, COUNT = 90, WIDTH = M * (LAGS + 1) };

static const double scale[M] = {2, 0.5, -3}, offset[M] = {1, -20, 7};
static double x[COUNT][M]; // in the numbers of the sums
static int16_t words[COUNT * M];
static int32_t longs[COUNT * M];
static void* block;
static okid_accumulator_t* sums;
static int first, rows; // of the regression

void setUp(void) {
    uint64_t seed = 4;
    for (int n = 0; n < COUNT; ++n)
        for (int c = 0; c < M; ++c) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            longs[n * M + c] = (int32_t)((int64_t)(seed >> 50) - 4000 + 3000 * c);
            words[n * M + c] = (int16_t)longs[n * M + c];
            x[n][c] = longs[n * M + c];
        }
}

void tearDown(void) {
    free(block);
    block = NULL;
}

static void make(okid_sample_t kind, int window, int edges, int bare) {
    okid_accumulator_config_t c = okid_accumulator_defaults(1, 2, LAGS);
    c.sample = kind;
    c.edges = edges;
    c.block = window ? 10 : 0;
    c.slots = window ? 4 : 0;
    const size_t bytes = okid_accumulator_memsize(&c);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &c, block, bytes));
    if (!bare) okid_accumulator_set_units(sums, scale, offset);
    okid_status_t status = OKID_OK;
    if (kind == OKID_SAMPLE_DOUBLE)
        status = okid_accumulator_add(sums, x[0], COUNT);
    else if (kind == OKID_SAMPLE_INT16)
        status = okid_accumulator_add_i16(sums, words, COUNT);
    else
        status = okid_accumulator_add_i32(sums, longs, COUNT);
    TEST_ASSERT_EQUAL(OKID_OK, status);
    rows = (int)okid_accumulator_rows(sums);
    first = COUNT - rows;
    TEST_ASSERT_TRUE(window ? rows >= 30 && rows < 50 : rows == COUNT - LAGS);
}

static void near(double expected, double found, double size) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * size, expected, found);
}

static double mean_of(int c, int lag) {
    double sum = 0;
    for (int n = first; n < COUNT; ++n) sum += x[n - lag][c];
    return sum / rows;
}

static void sums_of_a_run(int whole, int detrend, int bare) {
    double S[M * WIDTH], head[M * LAGS], tail[M * LAGS], sum[M], mean[M];
    okid_run_sums_t out = {S, head, tail, sum, mean, 0};
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_run(sums, detrend ? OKID_DETREND_MEAN : OKID_DETREND_NONE, &out));
    TEST_ASSERT_EQUAL_INT64(rows, out.rows);
    double gain[M], less[M]; // value = gain (x - less)
    for (int c = 0; c < M; ++c) {
        const double constant = whole ? floor(mean_of(c, 0) + 0.5) : mean_of(c, 0);
        gain[c] = bare ? 1 : scale[c];
        less[c] = detrend ? constant : bare ? 0 : -offset[c] / scale[c];
    }
    for (int c = 0; c < M; ++c) {
        near(gain[c] * mean_of(c, 0) + (bare ? 0 : offset[c]), mean[c], 1e5);
        near(rows * gain[c] * (mean_of(c, 0) - less[c]), sum[c], 1e7);
        for (int a = 0; a < LAGS; ++a) {
            near(gain[c] * (x[first - 1 - a][c] - less[c]), head[a * M + c], 1e5);
            near(gain[c] * (x[COUNT - 1 - a][c] - less[c]), tail[a * M + c], 1e5);
        }
        for (int b = 0; b <= LAGS; ++b)
            for (int r = 0; r < M; ++r) {
                double expected = 0;
                for (int n = first; n < COUNT; ++n)
                    expected += gain[r] * (x[n][r] - less[r]) * gain[c] * (x[n - b][c] - less[c]);
                near(expected, S[b * M * M + c * M + r], 1e11);
            }
    }
}

static void sums_of_a_run_are_those_over_its_rows(void) {
    for (int kind = OKID_SAMPLE_DOUBLE; kind <= OKID_SAMPLE_INT32; ++kind)
        for (int what = 0; what < 8; ++what) {
            make((okid_sample_t)kind, what & 1, !(what & 1), what >> 2 & 1);
            sums_of_a_run(kind != OKID_SAMPLE_DOUBLE, what >> 1 & 1, what >> 2 & 1);
        }
}

static void gram_and_lag_means_are_those_over_the_rows(void) {
    for (int kind = OKID_SAMPLE_DOUBLE; kind <= OKID_SAMPLE_INT32; ++kind)
        for (int what = 0; what < 8; ++what) {
            const int detrend = what >> 1 & 1, bare = what >> 2 & 1;
            make((okid_sample_t)kind, what & 1, !(what & 1), bare);
            double gram[WIDTH * WIDTH], mean[M], means[WIDTH];
            memset(means, 0xff, sizeof means);
            TEST_ASSERT_EQUAL(OKID_OK,
                              okid_accumulator_gram(sums, detrend ? OKID_DETREND_MEAN : OKID_DETREND_NONE, gram, mean));
            TEST_ASSERT_EQUAL_DOUBLE(rows, okid_accumulator_lag_means(sums, means));
            for (int j = 0; j < WIDTH; ++j) {
                const int cj = j % M, lj = j / M;
                const double gj = bare ? 1 : scale[cj], oj = bare ? 0 : offset[cj];
                near(gj * mean_of(cj, lj) + oj, means[j], 1e5);
                if (j < M) near(means[j], mean[j], 1e5);
                for (int i = 0; i < WIDTH; ++i) {
                    const int ci = i % M, li = i / M;
                    const double gi = bare ? 1 : scale[ci], oi = bare ? 0 : offset[ci];
                    double expected = 0;
                    for (int n = first; n < COUNT; ++n)
                        expected += (gi * x[n - li][ci] + oi - (detrend ? means[i] : 0)) *
                                    (gj * x[n - lj][cj] + oj - (detrend ? means[j] : 0));
                    near(expected, gram[j * WIDTH + i], 1e11);
                }
            }
        }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(sums_of_a_run_are_those_over_its_rows);
    RUN_TEST(gram_and_lag_means_are_those_over_the_rows);
    return UNITY_END();
}
