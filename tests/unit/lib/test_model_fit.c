// SPDX-License-Identifier: MIT
// okid_model_fit(), okid_model_simulate() and okid_model_predict() beside the equations written out: every size of model, A full or
// with a band, with samples missing.
#include <math.h>
#include <okid/model.h>
#include <stdlib.h>
#include <unity.h>

enum { MOST = 12, COUNT = 60 };

void setUp(void) {}
void tearDown(void) {}

static double draw(uint64_t* seed) { // -1 .. 1
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 4503599627370496.0 - 1;
}

/// The five sums of every output, by eq. (13), (15) with and without a correction by K.
static void written_out(const okid_model_t* m, const double* rows, const okid_real_t* x0, double* sums) {
    double x[2][MOST], next[MOST];
    for (int way = 0; way < 2; ++way)
        for (int j = 0; j < m->n_z; ++j) x[way][j] = x0 ? x0[j] : 0;
    for (int n = 0; n < COUNT; ++n, rows += m->n_u + m->n_y) {
        double left[2][MOST];
        int whole = 1;
        for (int o = 0; o < m->n_y; ++o) whole &= !isnan(rows[m->n_u + o]);
        for (int way = 0; way < 2; ++way) {
            for (int o = 0; o < m->n_y; ++o) {
                double y = 0;
                for (int i = 0; i < m->n_u; ++i) y += m->D[i * m->n_y + o] * rows[i];
                for (int j = 0; j < m->n_z; ++j) y += m->C[j * m->n_y + o] * x[way][j];
                left[way][o] = rows[m->n_u + o] - y;
                if (!isnan(left[way][o])) sums[way * m->n_y + o] += left[way][o] * left[way][o];
            }
            for (int j = 0; j < m->n_z; ++j) {
                next[j] = 0;
                for (int i = 0; i < m->n_u; ++i) next[j] += m->B[i * m->n_z + j] * rows[i];
                for (int i = 0; i < m->n_z; ++i) next[j] += m->A[i * m->n_z + j] * x[way][i];
                for (int o = 0; way && whole && m->K && o < m->n_y; ++o) next[j] += m->K[o * m->n_z + j] * left[1][o];
            }
            for (int j = 0; j < m->n_z; ++j) x[way][j] = next[j];
        }
        for (int o = 0; o < m->n_y; ++o) {
            const double y = rows[m->n_u + o];
            if (isnan(y)) continue;
            sums[2 * m->n_y + o] += y;
            sums[3 * m->n_y + o] += y * y;
            sums[4 * m->n_y + o] += 1;
        }
    }
}

/// What a model leaves of the outputs, squared and summed.
static void check_left(const okid_model_t* m, const double* rows, const okid_real_t* x0, int predicts,
                       const double* truth) {
    okid_real_t u[COUNT * MOST] = {0}, y[COUNT * MOST], out[COUNT * MOST];
    for (int n = 0; n < COUNT; ++n, rows += m->n_u + m->n_y) {
        for (int i = 0; i < m->n_u; ++i) u[n * m->n_u + i] = (okid_real_t)rows[i];
        for (int o = 0; o < m->n_y; ++o) y[n * m->n_y + o] = (okid_real_t)rows[m->n_u + o];
    }
    okid_real_t* work = malloc(okid_model_workspace(m) * sizeof *work);
    TEST_ASSERT_EQUAL(OKID_OK, predicts ? okid_model_predict(m, u, y, COUNT, x0, out, work)
                                        : okid_model_simulate(m, u, COUNT, x0, out, work));
    for (int o = 0; o < m->n_y; ++o) {
        double sum = 0;
        for (int k = o; k < COUNT * m->n_y; k += m->n_y) {
            const double left = (double)y[k] - (double)out[k];
            if (!isnan(left)) sum += left * left;
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-4 * (1 + truth[o]), truth[o], sum);
    }
    free(work);
}

static void both_ways(int n_u, int n_y, int n_z, int band, int corrects, int starts, int missing) {
    uint64_t seed = (uint64_t)(1 + n_u + 100 * n_y + 10000 * n_z);
    okid_real_t A[MOST * MOST], B[MOST * MOST], C[MOST * MOST], D[MOST * MOST], K[MOST * MOST], x0[MOST];
    double rows[COUNT * 2 * MOST], sums[5 * MOST] = {0}, truth[5 * MOST] = {0};
    for (int i = 0; i < MOST * MOST; ++i) {
        A[i] = (okid_real_t)(0.9 * draw(&seed) / n_z);
        B[i] = (okid_real_t)draw(&seed), C[i] = (okid_real_t)draw(&seed), D[i] = (okid_real_t)draw(&seed);
        K[i] = (okid_real_t)(0.2 * draw(&seed) / (n_z * n_y));
    }
    for (int i = 0; i < n_z * n_z; ++i)
        if (abs(i / n_z - i % n_z) > band) A[i] = 0;
    for (int j = 0; j < MOST; ++j) x0[j] = (okid_real_t)draw(&seed);
    for (int i = 0; i < COUNT * (n_u + n_y); ++i) rows[i] = draw(&seed);
    for (int n = 7; missing && n < COUNT; n += 9) rows[n * (n_u + n_y) + n_u + n % n_y] = NAN;
    const okid_model_t model = {n_u, n_y, n_z, A, B, C, D, corrects ? K : NULL};
    const size_t bytes = okid_model_fit_memsize(&model);
    void* work = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_fit(&model, rows, COUNT, starts ? x0 : NULL, sums, work, bytes));
    written_out(&model, rows, starts ? x0 : NULL, truth);
    for (int i = 0; i < 5 * n_y; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-6 * (1 + fabs(truth[i])), truth[i], sums[i]);
    free(work);
    check_left(&model, rows, starts ? x0 : NULL, 0, truth);
    if (corrects) check_left(&model, rows, starts ? x0 : NULL, 1, truth + n_y);
}

static void sums_are_those_of_the_equations(void) {
    for (int n_z = 1; n_z <= MOST; ++n_z)
        for (int n_y = 1; n_y <= 9; n_y += 2)
            for (int what = 0; what < 8; ++what)
                for (int band = 0; band <= MOST; band += band < 3 ? 1 : MOST - 3)
                    both_ways(what % 3, n_y, n_z, band, what & 1, what & 2, what & 4);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(sums_are_those_of_the_equations);
    return UNITY_END();
}
