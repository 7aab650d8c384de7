// SPDX-License-Identifier: MIT
// Maximum-likelihood refinement: exact without noise from a rough start, its replicates, gaps, and wrong use.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { N = 4000, BLOCKS = 20 };
static const double exact_limit = TOLERANCE(1e-9, 2e-6); // float: A, B, C, D are rounded on the way out

static rig_t rig;
static okid_real_t A[RIG_NZ * RIG_NZ], B[RIG_NZ], C[RIG_NY * RIG_NZ], D[RIG_NY];
static okid_model_t start = {RIG_NU, RIG_NY, RIG_NZ, A, B, C, D, NULL};
static okid_refined_t found;
static okid_refine_t* self;
static void* block;

/// The truth, with every pole, B, C and D wrong by some `error`.
static void set_start(double error) {
    rig_t rough;
    rig_make(&rig);
    rough = rig;
    uint64_t state = 77;
    for (int k = 0; k < RIG_MODES; ++k) {
        const double turn = error / 10 * (k + 1), shrink = 1 - error / 50;
        const double x = shrink * cos(turn), y = shrink * sin(turn);
        double *a = rough.A + 2 * k * RIG_NZ + 2 * k, *b = a + RIG_NZ;
        const double re = a[0], im = a[1];
        a[0] = b[1] = re * x - im * y;
        a[1] = re * y + im * x;
        b[0] = -a[1];
    }
    for (int i = 0; i < RIG_NZ; ++i) rough.B[i] *= 1 + error * rig_normal(&state);
    for (int i = 0; i < RIG_NY * RIG_NZ; ++i) rough.C[i] *= 1 + error * rig_normal(&state);
    for (int i = 0; i < RIG_NY; ++i) rough.D[i] *= 1 + error * rig_normal(&state);
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) A[i] = (okid_real_t)rough.A[i];
    for (int i = 0; i < RIG_NZ; ++i) B[i] = (okid_real_t)rough.B[i];
    for (int i = 0; i < RIG_NY * RIG_NZ; ++i) C[i] = (okid_real_t)rough.C[i];
    for (int i = 0; i < RIG_NY; ++i) D[i] = (okid_real_t)rough.D[i];
}

void setUp(void) {
    set_start(0.02);
    self = NULL;
    block = NULL;
}
void tearDown(void) { free(block); }

static okid_status_t refine(int runs, int offset, int blocks, const int32_t* counts, const double* samples) {
    const okid_refine_config_t config = {RIG_NU, RIG_NY, RIG_NZ, runs, blocks, 0, offset};
    const size_t bytes = okid_refine_memsize(&config);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
    return okid_refine_run(self, &start, counts, samples, &found);
}

static void modes_of(const okid_real_t* a, const okid_real_t* c, okid_real_t* f, okid_real_t* zeta) {
    const size_t bytes = okid_modal_memsize(RIG_NY, RIG_NZ);
    void* work = malloc(bytes);
    const okid_model_t model = {.n_u = RIG_NU, .n_y = RIG_NY, .n_z = RIG_NZ, .A = a, .C = c};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta};
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, 1 / RIG_FS, &modes, work, bytes));
    TEST_ASSERT_EQUAL(RIG_MODES, modes.count);
    free(work);
}

/// Worst relative error of frequency and, a hundredth of it, of damping.
static double mode_error(const okid_real_t* a, const okid_real_t* c) {
    okid_real_t f[RIG_NZ], zeta[RIG_NZ];
    modes_of(a, c, f, zeta);
    double worst = 0;
    for (int k = 0; k < RIG_MODES; ++k) {
        worst = fmax(worst, fabs((double)f[k] / rig_frequency[k] - 1));
        worst = fmax(worst, fabs((double)zeta[k] / rig_damping[k] - 1) / 100);
    }
    return worst;
}

static void a_rough_start_finds_the_truth(void) {
    const int32_t count = N;
    double* v = rig_record(&rig, N, 0, NULL, 5);
    TEST_ASSERT_TRUE(mode_error(A, C) > 1e-3);
    TEST_ASSERT_TRUE(refine(1, 0, 0, &count, v) >= 0);
    TEST_ASSERT_TRUE(found.iterations > 1);
    TEST_ASSERT_TRUE(mode_error(found.A, found.C) < exact_limit);
    TEST_ASSERT_TRUE(found.gain > 1000);
    for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_TRUE(fabs((double)found.D[o] - rig.D[o]) < 10 * exact_limit);
    free(v);
}

static void an_unknown_constant_does_no_harm(void) {
    const int32_t count = N;
    double* v = rig_record(&rig, N, 0, NULL, 5);
    for (int n = 0; n < N; ++n)
        for (int o = 0; o < RIG_NY; ++o) v[n * RIG_M + 1 + o] += 3 + o;
    TEST_ASSERT_TRUE(refine(1, 1, 0, &count, v) >= 0);
    TEST_ASSERT_TRUE(mode_error(found.A, found.C) < exact_limit);
    TEST_ASSERT_TRUE(refine(1, 0, 0, &count, v) >= 0);
    TEST_ASSERT_TRUE(mode_error(found.A, found.C) > exact_limit);
    free(v);
}

// Every step, what it gains and where it ends: as without the constant.
static void with_an_offset_a_constant_changes_nothing(void) {
    const int32_t counts[2] = {N / 2, N / 2};
    double* v = rig_record(&rig, N, 0.05, NULL, 5);
    okid_real_t a[RIG_NZ * RIG_NZ], d[RIG_NY];
    TEST_ASSERT_EQUAL(OKID_OK, refine(2, 1, 0, counts, v));
    const okid_refined_t before = found;
    memcpy(a, found.A, sizeof a);
    memcpy(d, found.D, sizeof d);
    for (int n = 0; n < N; ++n) // another one in each run
        for (int o = 0; o < RIG_NY; ++o) v[n * RIG_M + 1 + o] += (3 + o) * (n < N / 2 ? 1 : -2);
    TEST_ASSERT_EQUAL(OKID_OK, refine(2, 1, 0, counts, v));
    TEST_ASSERT_EQUAL(before.iterations, found.iterations);
    TEST_ASSERT_EQUAL(1, found.converged);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * before.gain, before.gain, found.gain);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, before.decrement, found.decrement);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, before.whiteness, found.whiteness);
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) TEST_ASSERT_DOUBLE_WITHIN(exact_limit, (double)a[i], (double)found.A[i]);
    for (int i = 0; i < RIG_NY; ++i) TEST_ASSERT_DOUBLE_WITHIN(10 * exact_limit, (double)d[i], (double)found.D[i]);
    free(v);
}

static void runs_have_their_own_beginnings(void) {
    const int32_t counts[2] = {N, N / 2};
    double *v = malloc(sizeof *v * (N + N / 2) * RIG_M), x0[RIG_NZ];
    for (int r = 0; r < 2; ++r) {
        for (int i = 0; i < RIG_NZ; ++i) x0[i] = r == 0 ? 20 : -10 * i;
        double* one = rig_record(&rig, counts[r], 0, x0, 5 + (uint64_t)r);
        memcpy(v + (r == 0 ? 0 : N * RIG_M), one, sizeof *v * (size_t)counts[r] * RIG_M);
        free(one);
    }
    for (int n = 100; n < 180; ++n) v[n * RIG_M + 2] = NAN; // a sensor that was off for a while
    TEST_ASSERT_TRUE(refine(2, 0, 0, counts, v) >= 0);
    TEST_ASSERT_EQUAL(N + N / 2 - 80, found.samples);
    TEST_ASSERT_TRUE(mode_error(found.A, found.C) < exact_limit);
    const okid_model_t model = {RIG_NU, RIG_NY, RIG_NZ, found.A, found.B, found.C, found.D, NULL};
    okid_real_t u[20], y[20 * RIG_NY];
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&model));
    for (int r = 0; r < 2; ++r) {
        const double* first = v + (r == 0 ? 0 : N * RIG_M);
        for (int n = 0; n < 20; ++n) u[n] = (okid_real_t)first[n * RIG_M];
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&model, u, 20, found.x0 + r * RIG_NZ, y, work));
        for (int n = 0; n < 20; ++n)
            for (int o = 0; o < RIG_NY; ++o)
                TEST_ASSERT_TRUE(fabs((double)y[n * RIG_NY + o] - first[n * RIG_M + 1 + o]) < 1e4 * exact_limit);
    }
    free(work);
    free(v);
}

static void noise_is_measured_and_replicates_scatter_like_the_errors(void) {
    enum { RECORDS = 12 };
    const int32_t count = N;
    double share = 0; // of the squared errors in what the replicates say, 1 on average
    for (int r = 0; r < RECORDS; ++r) {
        double* v = rig_record(&rig, N, 0.05, NULL, 100 + (uint64_t)r);
        okid_real_t full_f[RIG_NZ], full_zeta[RIG_NZ], f[RIG_NZ], zeta[RIG_NZ];
        static okid_real_t a[RIG_NZ * RIG_NZ], b[RIG_NZ], c[RIG_NY * RIG_NZ], d[RIG_NY];
        double sum_f[RIG_MODES] = {0}, sum_zeta[RIG_MODES] = {0};
        TEST_ASSERT_EQUAL(OKID_OK, refine(1, 0, BLOCKS, &count, v));
        TEST_ASSERT_EQUAL(1, found.converged);
        TEST_ASSERT_TRUE(found.gain > 0 && found.decrement < 1e-2);
        TEST_ASSERT_TRUE(found.whiteness > 0.4 && found.whiteness < 1.8);
        for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_TRUE(fabs((double)found.noise_std[o] / 0.15 - 1) < 0.05);
        modes_of(found.A, found.C, full_f, full_zeta);
        for (int j = 0; j < BLOCKS; ++j) {
            TEST_ASSERT_EQUAL(OKID_OK, okid_refine_replicate(self, j, a, b, c, d));
            modes_of(a, c, f, zeta);
            for (int k = 0; k < RIG_MODES; ++k) {
                sum_f[k] += pow((double)f[k] - (double)full_f[k], 2) * (BLOCKS - 1) / BLOCKS;
                sum_zeta[k] += pow((double)zeta[k] - (double)full_zeta[k], 2) * (BLOCKS - 1) / BLOCKS;
            }
        }
        for (int k = 0; k < RIG_MODES; ++k) {
            share += pow((double)full_f[k] - rig_frequency[k], 2) / sum_f[k] / (2 * RIG_MODES * RECORDS);
            share += pow((double)full_zeta[k] - rig_damping[k], 2) / sum_zeta[k] / (2 * RIG_MODES * RECORDS);
        }
        free(v);
    }
    TEST_ASSERT_TRUE(share > 0.6 && share < 1.7); // 72 squares of t-like numbers: 1.1 +- 0.2
}

static void wrong_use_is_refused(void) {
    okid_refine_config_t config = {RIG_NU, RIG_NY, RIG_NZ, 1, 0, 0, 0};
    const size_t bytes = okid_refine_memsize(&config);
    const int32_t count = N, few = 10, negative = -1;
    double* v = rig_record(&rig, N, 0.01, NULL, 5);
    TEST_ASSERT_EQUAL(OKID_OK, refine(1, 0, 0, &count, v));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_refine_replicate(self, 0, A, B, C, D)); // no blocks
    TEST_ASSERT_EQUAL(OKID_OK, refine(1, 0, 2, &count, v));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_refine_replicate(self, 2, A, B, C, D));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_refine_replicate(self, -1, A, B, C, D));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_refine_replicate(self, 0, NULL, B, C, D));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_refine_create(&self, &config, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_refine_create(&self, &config, NULL, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_refine_run(self, &start, &count, NULL, &found));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, refine(1, 0, 0, &few, v));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, refine(1, 0, 0, &negative, v));
    v[7 * RIG_M] = NAN;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, refine(1, 0, 0, &count, v)); // an input that is missing
    okid_model_t other = start;
    other.n_z = 4;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_refine_run(self, &other, &count, v, &found));
    const okid_refine_config_t bad[] = {{0, 1, 1, 0, 0, 0, 0},  {1, 0, 1, 1, 0, 0, 0}, {1, 1, 0, 1, 0, 0, 0},
                                        {1, 1, 1, -1, 0, 0, 0}, {1, 1, 1, 1, 1, 0, 0}, {1, 1, 1, 1, 65, 0, 0},
                                        {1, 1, 1, 1, 0, -1, 0}, {1, 1, 1, 1, 0, 0, 2}, {99, 9, 999, 9, 0, 0, 0}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
        TEST_ASSERT_EQUAL(0, okid_refine_memsize(&bad[i]));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_refine_create(&self, &bad[i], block, bytes));
    }
    TEST_ASSERT_EQUAL(0, okid_refine_memsize(NULL));
    free(v);
}

static void starts_that_cannot_be_simulated_are_refused(void) {
    const int32_t count = N;
    double* v = rig_record(&rig, N, 0.01, NULL, 5);
    A[0] = A[RIG_NZ + 1] = (okid_real_t)1.01;
    A[1] = (okid_real_t)0.1;
    A[RIG_NZ] = (okid_real_t)-0.1;
    TEST_ASSERT_EQUAL(OKID_ERR_UNSTABLE, refine(1, 0, 0, &count, v));
    memset(A, 0, sizeof A);
    for (int i = 0; i + 1 < RIG_NZ; ++i) A[(i + 1) * RIG_NZ + i] = 1; // one eigenvector for all
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, refine(1, 0, 0, &count, v));
    A[0] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, refine(1, 0, 0, &count, v));
    free(v);
}

static void a_dead_state_stays_where_it_is(void) {
    const int32_t count = N;
    double* v = rig_record(&rig, N, 0.01, NULL, 5);
    for (int i = 4; i < RIG_NZ; ++i) B[i] = 0; // the start does not drive its third mode
    TEST_ASSERT_TRUE(refine(1, 0, 2, &count, v) >= 0);
    TEST_ASSERT_TRUE(found.gain >= 0 && isfinite(found.gain));
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) TEST_ASSERT_TRUE(isfinite((double)found.A[i]));
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(a_rough_start_finds_the_truth);
    RUN_TEST(an_unknown_constant_does_no_harm);
    RUN_TEST(with_an_offset_a_constant_changes_nothing);
    RUN_TEST(runs_have_their_own_beginnings);
    RUN_TEST(noise_is_measured_and_replicates_scatter_like_the_errors);
    RUN_TEST(wrong_use_is_refused);
    RUN_TEST(starts_that_cannot_be_simulated_are_refused);
    RUN_TEST(a_dead_state_stays_where_it_is);
    return UNITY_END();
}
