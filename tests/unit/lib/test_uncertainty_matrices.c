// SPDX-License-Identifier: MIT
// Deviations of M, K, R, alpha and beta: those of the formula for structures that scatter in a known way, and what is left
// of them when models give no matrices.
#include "mkr_rig.h"

enum { G = 10, N_X = 3 };

static structure_t s;
static system_t reference;
static okid_mkr_config_t mkr;
static okid_replicates_t* self;
static void* block;

/// W1 with its matrices changed by some part, in a realization of its own.
static okid_model_t vary(const double* part, uint64_t seed, system_t* out) {
    static const int32_t force = 0, dofs[N_X] = {0, 1, 2}, kinds[N_X] = {2, 2, 2};
    s_make(&s, 1);
    s.alpha *= 1 + part[2];
    s.beta *= 1 + part[3];
    for (int i = 0; i < N_X * N_X; ++i) {
        s.M[i] *= (okid_real_t)(1 + part[0]);
        s.K[i] *= (okid_real_t)(1 + part[1]);
        s.R[i] = (okid_real_t)(s.alpha * (double)s.M[i] + s.beta * (double)s.K[i]);
    }
    mkr_system(&s, out, 1, &force, N_X, dofs, kinds, OKID_HOLD_ZERO, seed);
    return s_view(out);
}

void setUp(void) {
    const double none[4] = {0};
    const okid_model_t full = vary(none, 1, &reference);
    mkr = (okid_mkr_config_t){N_X,  OKID_HOLD_ZERO,       reference.dt, reference.input_dof,
                              NULL, reference.output_dof, NULL,         reference.sensing};
    const okid_replicates_config_t config = {1, N_X, 2 * N_X, &mkr};
    const size_t bytes = okid_replicates_memsize(&config);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&self, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(self, &full, reference.dt));
}
void tearDown(void) { free(block); }

/// The formula of the header for numbers of equal shares: sqrt((g - 1)/g sum of squares about their mean).
static double expected(const double* value) {
    double mean = 0, sum = 0;
    for (int j = 0; j < G; ++j) mean += value[j] / G;
    for (int j = 0; j < G; ++j) sum += (value[j] - mean) * (value[j] - mean);
    return sqrt(sum * (G - 1) / G);
}

static void assert_deviations(const okid_real_t* std, double value[][N_X * N_X], double limit) {
    for (int i = 0; i < N_X * N_X; ++i) {
        double column[G], largest = 0;
        for (int j = 0; j < G; ++j) {
            column[j] = value[j][i];
            for (int k = 0; k < N_X * N_X; ++k) largest = fmax(largest, fabs(value[j][k]));
        }
        TEST_ASSERT_TRUE(fabs((double)std[i] - expected(column)) < limit * largest);
    }
}

static void deviations_are_those_of_the_formula(void) {
    static double M[G][N_X * N_X], K[G][N_X * N_X], R[G][N_X * N_X];
    double alpha[G], beta[G];
    uint64_t state = 9;
    for (int j = 0; j < G; ++j) {
        double part[4];
        for (int i = 0; i < 4; ++i) part[i] = 0.02 * (s_uniform(&state) - 0.5);
        system_t one;
        const okid_model_t model = vary(part, 100 + (uint64_t)j, &one);
        TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_add(self, &model, 1.0 / G));
        alpha[j] = s.alpha;
        beta[j] = s.beta;
        for (int i = 0; i < N_X * N_X; ++i) {
            M[j][i] = (double)s.M[i];
            K[j][i] = (double)s.K[i];
            R[j][i] = (double)s.R[i];
        }
    }
    okid_uncertainty_t out;
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_finish(self, &out));
    TEST_ASSERT_EQUAL(N_X, out.n_x);
    TEST_ASSERT_EQUAL(G, out.mkr_used);
    assert_deviations(out.M_std, M, 1e-9);
    assert_deviations(out.K_std, K, 1e-9);
    assert_deviations(out.R_std, R, 1e-8);
    assert_deviations(out.R_normal_std, R, 1e-8);
    TEST_ASSERT_TRUE((double)out.M_std[0] > 1e-3); // a part of 0.02 / sqrt(12) of 1 kg, nine times
    TEST_ASSERT_TRUE(fabs(out.alpha_std / expected(alpha) - 1) < 1e-6);
    TEST_ASSERT_TRUE(fabs(out.beta_std / expected(beta) - 1) < 1e-6);
}

/// Ten models of which every `step`-th gives modes, but no matrices. @return what finish() says
static okid_status_t look(int step, okid_uncertainty_t* out) {
    const double none[4] = {0};
    const okid_model_t full = s_view(&reference);
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(self, &full, reference.dt));
    for (int j = 0; j < G; ++j) {
        system_t one;
        okid_model_t model = vary(none, 100 + (uint64_t)j, &one);
        if (j % step == 0 && j % 2 == 0) model.B = NULL;
        if (j % step == 0 && j % 2 != 0) model.D = NULL;
        TEST_ASSERT_EQUAL(j % step == 0 ? OKID_WARN_MODEL : OKID_OK, okid_replicates_add(self, &model, 1.0 / G));
    }
    return okid_replicates_finish(self, out);
}

static void models_without_matrices_are_counted(void) {
    okid_uncertainty_t out;
    TEST_ASSERT_EQUAL(OKID_OK, look(5, &out));
    TEST_ASSERT_EQUAL(G - 2, out.mkr_used);
    TEST_ASSERT_EQUAL(G, out.used[0]);
    TEST_ASSERT_TRUE((double)out.M_std[0] < 1e-9 && out.alpha_std < 1e-9); // of structures that do not scatter
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, look(3, &out));                     // without 0, 3, 6, 9: over a quarter
    TEST_ASSERT_EQUAL(G - 4, out.mkr_used);
    TEST_ASSERT_TRUE(isnan((double)out.M_std[0]) && isnan((double)out.R_normal_std[4]) && isnan(out.beta_std));
    TEST_ASSERT_FALSE(isnan((double)out.frequency_std_hz[0]));
}

static void a_full_model_without_matrices_is_said(void) {
    okid_uncertainty_t out;
    const double none[4] = {0};
    system_t one;
    okid_model_t model = vary(none, 3, &one);
    model.B = NULL;
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_replicates_begin(self, &model, reference.dt));
    model.B = one.B;
    for (int j = 0; j < G; ++j) TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_add(self, &model, 1.0 / G));
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_replicates_finish(self, &out));
    TEST_ASSERT_EQUAL(0, out.mkr_used);
    TEST_ASSERT_TRUE(isnan((double)out.M_std[0]) && isnan(out.alpha_std));
    TEST_ASSERT_FALSE(isnan((double)out.frequency_std_hz[0]));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(deviations_are_those_of_the_formula);
    RUN_TEST(models_without_matrices_are_counted);
    RUN_TEST(a_full_model_without_matrices_is_said);
    return UNITY_END();
}
