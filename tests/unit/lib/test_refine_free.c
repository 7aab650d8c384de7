// SPDX-License-Identifier: MIT
// Refinement of free decays: no input, initial states alone. The samples are sums of damped cosines, no state-space model.
#include "tolerance.h"

#include <math.h>
#include <okid/okid.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { MODES = 2, NZ = 2 * MODES, NY = 2, RUNS = 2, COUNT = 600, DRAWS = 64, RECORDS = 24 };
static const double pi = 3.14159265358979323846;
static const double turn[MODES] = {0.3, 1.1},
                    decay[MODES] = {0.004, 0.08}; // the second is gone after a tenth of the run
static const double size[RUNS][MODES] = {{1, 0.5}, {-0.3, 1.5}}, phase[RUNS][MODES] = {{0.2, 1}, {2, -0.7}};
static const double shape[NY][MODES] = {{1, -0.6}, {0.5, 1}};

static okid_real_t A[NZ * NZ], C[NY * NZ];
static okid_model_t start = {0, NY, NZ, A, NULL, C, NULL, NULL};
static okid_refined_t found;
static okid_refine_t* self;
static void* block;
static double samples[RUNS * COUNT * NY];
static uint64_t state;

/// Sum of twelve uniform numbers: mean 0, variance 1.
static double normal(void) {
    double sum = -6;
    for (int i = 0; i < 12; ++i) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(state >> 11) / 9007199254740992.0;
    }
    return sum;
}

static void record(double noise) {
    for (int r = 0; r < RUNS; ++r)
        for (int t = 0; t < COUNT; ++t)
            for (int o = 0; o < NY; ++o) {
                double y = noise * normal();
                for (int k = 0; k < MODES; ++k)
                    y += shape[o][k] * size[r][k] * exp(-decay[k] * t) * cos(turn[k] * t + phase[r][k]);
                samples[(r * COUNT + t) * NY + o] = y;
            }
}

static okid_status_t refine(int blocks) {
    const okid_refine_config_t config = {0, NY, NZ, RUNS, blocks, 0, 0};
    const int32_t counts[RUNS] = {COUNT, COUNT};
    const size_t bytes = okid_refine_memsize(&config);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    return okid_refine_run(self, &start, counts, samples, &found);
}

/// Worst error of turns and decays.
static double errors(const okid_real_t* a, double* of_turn, double* of_decay) {
    okid_real_t f[NZ], zeta[NZ];
    const size_t bytes = okid_modal_memsize(NY, NZ);
    void* work = malloc(bytes);
    const okid_model_t model = {.n_u = 0, .n_y = NY, .n_z = NZ, .A = a, .C = C};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta};
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, 1, &modes, work, bytes));
    TEST_ASSERT_EQUAL(MODES, modes.count);
    free(work);
    double worst = 0;
    for (int k = 0; k < MODES; ++k) {
        const double w = 2 * pi * (double)f[k];
        of_decay[k] = (double)zeta[k] * w - decay[k];
        of_turn[k] = w * sqrt(1 - (double)zeta[k] * (double)zeta[k]) - turn[k];
        worst = fmax(worst, fmax(fabs(of_decay[k]), fabs(of_turn[k])));
    }
    return worst;
}

void setUp(void) {
    memset(A, 0, sizeof A);
    for (int k = 0; k < MODES; ++k) { // a hundredth off
        const double r = exp(-1.2 * decay[k]);
        okid_real_t *a = A + 2 * k * NZ + 2 * k, *b = a + NZ;
        a[0] = b[1] = (okid_real_t)(r * cos(1.01 * turn[k]));
        a[1] = (okid_real_t)(r * sin(1.01 * turn[k]));
        b[0] = -a[1];
        for (int o = 0; o < NY; ++o) {
            C[2 * k * NY + o] = (okid_real_t)(1.1 * shape[o][k]);
            C[(2 * k + 1) * NY + o] = (okid_real_t)0.05;
        }
    }
    state = 3;
    self = NULL;
    block = NULL;
}
void tearDown(void) { free(block); }

static void without_noise_the_decays_are_exact(void) {
    double of_turn[MODES], of_decay[MODES];
    record(0);
    TEST_ASSERT_TRUE(errors(A, of_turn, of_decay) > 1e-3);
    TEST_ASSERT_TRUE(refine(0) >= 0);
    TEST_ASSERT_EQUAL(RUNS * COUNT, found.samples);
    TEST_ASSERT_TRUE(errors(found.A, of_turn, of_decay) < TOLERANCE(1e-9, 1e-5));
}

/// Of the mode that lives in one of twenty blocks, too.
static void replicates_scatter_as_the_errors_do(void) {
    double share[MODES] = {0};
    for (int record_at = 0; record_at < RECORDS; ++record_at) {
        static okid_real_t a[NZ * NZ], c[NY * NZ], none[1];
        double of_turn[MODES], of_decay[MODES], t[MODES], d[MODES], sum_turn[MODES] = {0}, sum_decay[MODES] = {0};
        record(0.02);
        TEST_ASSERT_EQUAL(OKID_OK, refine(DRAWS));
        TEST_ASSERT_EQUAL(1, found.converged);
        TEST_ASSERT_TRUE(found.whiteness > 0.4 && found.whiteness < 1.8);
        for (int o = 0; o < NY; ++o) TEST_ASSERT_TRUE(fabs((double)found.noise_std[o] / 0.02 - 1) < 0.1);
        (void)errors(found.A, of_turn, of_decay);
        for (int j = 0; j < DRAWS; ++j) {
            TEST_ASSERT_EQUAL(OKID_OK, okid_refine_replicate(self, j, a, none, c, none));
            (void)errors(a, t, d);
            for (int k = 0; k < MODES; ++k) {
                sum_turn[k] += pow(t[k] - of_turn[k], 2) * (DRAWS - 1) / DRAWS;
                sum_decay[k] += pow(d[k] - of_decay[k], 2) * (DRAWS - 1) / DRAWS;
            }
        }
        for (int k = 0; k < MODES; ++k)
            share[k] +=
                (of_turn[k] * of_turn[k] / sum_turn[k] + of_decay[k] * of_decay[k] / sum_decay[k]) / (2 * RECORDS);
    }
    for (int k = 0; k < MODES; ++k) TEST_ASSERT_TRUE(share[k] > 0.5 && share[k] < 1.7); // 48 squares: 1 +- 0.2
}

static void sums_need_an_input(void) {
    const okid_refine_config_t of_sums = {0, NY, NZ, 0, 0, 0, 0};
    TEST_ASSERT_EQUAL(0, okid_refine_memsize(&of_sums));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(without_noise_the_decays_are_exact);
    RUN_TEST(replicates_scatter_as_the_errors_do);
    RUN_TEST(sums_need_an_input);
    return UNITY_END();
}
