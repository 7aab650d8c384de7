// SPDX-License-Identifier: MIT
// Maximum-likelihood refinement with two forces and a pole on the real axis beside a mode: exact without noise.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { NU = 2, NY = 2, NZ = 3, M = NU + NY, N = 3000, L = 1000 };
static const double real_pole = 0.9, radius = 0.985, angle = 0.6;

typedef struct truth_t {
    okid_real_t A[NZ * NZ], B[NZ * NU], C[NY * NZ], D[NY * NU];
} truth_t;

static okid_model_t view(const truth_t* t) {
    return (okid_model_t){.n_u = NU, .n_y = NY, .n_z = NZ, .A = t->A, .B = t->B, .C = t->C, .D = t->D};
}

static void make(double pole, double size, double turn, double off, truth_t* out) {
    memset(out, 0, sizeof *out);
    out->A[0] = out->A[NZ + 1] = (okid_real_t)(size * cos(turn));
    out->A[1] = (okid_real_t)(size * sin(turn));
    out->A[NZ] = -out->A[1];
    out->A[2 * NZ + 2] = (okid_real_t)pole;
    uint64_t state = 21;
    for (int i = 0; i < NZ * NU; ++i) out->B[i] = (okid_real_t)((0.5 + rig_uniform(&state)) * (1 + off * (i % 3)));
    for (int i = 0; i < NY * NZ; ++i) out->C[i] = (okid_real_t)((rig_uniform(&state) - 0.3) * (1 - off * (i % 2)));
    for (int i = 0; i < NY * NU; ++i) out->D[i] = (okid_real_t)(rig_uniform(&state) + off);
}

static double *samples, *u, *y;

void setUp(void) {
    truth_t truth;
    uint64_t state = 4;
    make(real_pole, radius, angle, 0, &truth);
    const okid_model_t model = view(&truth);
    const okid_real_t x0[NZ] = {2, -1, 3};
    u = malloc(sizeof *u * N * NU);
    y = malloc(sizeof *y * N * NY);
    samples = malloc(sizeof *samples * N * M);
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    for (int i = 0; i < N * NU; ++i) u[i] = rig_normal(&state);
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&model, u, N, x0, y, work));
    free(work);
    for (int n = 0; n < N; ++n) {
        memcpy(samples + n * M, u + n * NU, sizeof *u * NU);
        memcpy(samples + n * M + NU, y + n * NY, sizeof *y * NY);
    }
}
void tearDown(void) { free(u), free(y), free(samples); }

/// Markov parameters and poles of what was found; what the states are called is free.
static void is_the_truth(const okid_refined_t* found, double most) {
    truth_t truth;
    make(real_pole, radius, angle, 0, &truth);
    double left[NZ * NU], right[NZ * NU], worst = 0;
    for (int i = 0; i < NZ * NU; ++i) {
        left[i] = found->B[i];
        right[i] = truth.B[i];
    }
    for (int step = 0; step < 40; ++step)
        for (int j = 0; j < NU; ++j) {
            double next[2][NZ] = {{0}};
            for (int o = 0; o < NY; ++o) {
                double a = 0, b = 0;
                for (int i = 0; i < NZ; ++i) {
                    a += found->C[i * NY + o] * left[j * NZ + i];
                    b += truth.C[i * NY + o] * right[j * NZ + i];
                }
                worst = fmax(worst, fabs(a - b));
            }
            for (int i = 0; i < NZ; ++i)
                for (int k = 0; k < NZ; ++k) {
                    next[0][i] += found->A[k * NZ + i] * left[j * NZ + k];
                    next[1][i] += truth.A[k * NZ + i] * right[j * NZ + k];
                }
            memcpy(left + j * NZ, next[0], sizeof next[0]);
            memcpy(right + j * NZ, next[1], sizeof next[1]);
        }
    TEST_ASSERT_TRUE(worst < most);
    for (int i = 0; i < NY * NU; ++i) TEST_ASSERT_TRUE(fabs(found->D[i] - truth.D[i]) < most);
    double trace = 0;
    for (int i = 0; i < NZ; ++i) trace += found->A[i * NZ + i];
    TEST_ASSERT_TRUE(fabs(trace - 2 * radius * cos(angle) - real_pole) < most);
}

static void poles_and_residues_of_both_forces_are_found(void) {
    truth_t rough;
    make(real_pole - 0.02, radius - 0.003, angle + 0.002, 0.05, &rough);
    const okid_model_t start = view(&rough);
    okid_refine_config_t config = {NU, NY, NZ, 1, 0, 0, 0};
    const int32_t count = N;
    const size_t bytes = okid_refine_memsize(&config);
    void* block = malloc(bytes);
    okid_refine_t* self = NULL;
    okid_refined_t found;
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    TEST_ASSERT_TRUE(okid_refine_run(self, &start, &count, samples, &found) >= 0);
    TEST_ASSERT_TRUE(found.iterations > 1);
    is_the_truth(&found, 1e-9);
    free(block);
}

static void and_from_the_sums(void) {
    truth_t rough;
    make(real_pole - 0.02, radius - 0.003, angle + 0.002, 0.05, &rough);
    const okid_model_t start = view(&rough);
    const okid_correlation_config_t lagged = okid_correlation_defaults(NU, NY, L);
    const okid_refine_config_t config = {NU, NY, NZ, 0, 0, 0, 0};
    const size_t bytes = okid_refine_memsize(&config), sum_bytes = okid_correlation_memsize(&lagged);
    void *block = malloc(bytes), *sum_block = malloc(sum_bytes);
    okid_correlation_t* sums = NULL;
    okid_refine_t* self = NULL;
    okid_correlation_sums_t made;
    okid_refined_t found;
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&sums, &lagged, sum_block, sum_bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, samples, N));
    const size_t room_bytes = okid_correlation_sums_memsize(sums);
    void* room = malloc(room_bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(sums, OKID_DETREND_NONE, &made, room, room_bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    TEST_ASSERT_TRUE(okid_refine_from_correlation(self, &start, &made, &found) >= 0);
    is_the_truth(&found, 1e-4); // what still rings after the lags is left out
    free(block), free(sum_block), free(room);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(poles_and_residues_of_both_forces_are_found);
    RUN_TEST(and_from_the_sums);
    return UNITY_END();
}
