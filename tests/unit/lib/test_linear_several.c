// SPDX-License-Identifier: MIT
// The derivative of an identification along the sums of a part, of several forces and sensors, against central
// differences of the identification itself. The order is all that there is room for.
#include "derivative.h"
#include "tolerance.h"

enum { P = 12, ROWS = 8, N = 4000, FIRST = 2000, LAST = 2020 };

static wide_t rig;
static double *record, *outputs; // the same without the forces

void setUp(void) {}
void tearDown(void) {
    free(record), free(outputs);
    record = outputs = NULL;
}

/// Two forces and three sensors, three forces and two sensors, with noise of this size and offsets.
static void make(int which, double noise) {
    wide_make(&rig, 2 + which, 3 - which);
    const int m = rig.n_u + rig.n_y;
    tearDown();
    record = wide_record(&rig, N, noise, 11 + (uint64_t)which);
    outputs = malloc(sizeof *outputs * (size_t)(N * rig.n_y));
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < m; ++c) {
            record[n * m + c] += 1 + c;
            if (c >= rig.n_u) outputs[n * rig.n_y + c - rig.n_u] = record[n * m + c];
        }
}

static void feed(okid_accumulator_t* to, int n_u, int first, int last) {
    const double* from = n_u > 0 ? record + first * (n_u + rig.n_y) : outputs + first * rig.n_y;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(to, from, (size_t)(last - first)));
}

static setting_t prepare(okid_method_t method, int n_u) {
    const okid_identify_config_t c = {.n_u = n_u,
                                      .n_y = rig.n_y,
                                      .p = method < OKID_METHOD_N4SID_MOESP && n_u > 0 ? P : 0,
                                      .rows = ROWS,
                                      .order = WIDE_NZ,
                                      .max_order = WIDE_NZ,
                                      .fs_hz = WIDE_FS,
                                      .method = method,
                                      .detrend = OKID_DETREND_MEAN};
    setting_t s = setting_make(&c, wide_frequency);
    feed(s.whole, n_u, 0, N);
    feed(s.part, n_u, FIRST - s.config.sums.lags, LAST);
    return s;
}

static void is_the_derivative(okid_method_t method, int n_u) {
    setting_t s = prepare(method, n_u);
    okid_accumulator_t *more = setting_sums(&s), *less = setting_sums(&s);
    feed(more, n_u, 0, N);
    feed(less, n_u, 0, N);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(more, s.part));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(less, s.part, 1));
    const printed_t low = identified(&s, less), high = identified(&s, more);
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    double share = 0;
    const printed_t down = changed(&s, 1, &share), up = changed(&s, -1, &share), again = changed(&s, 1, &share);
    const double scale = 1 - share, most = TOLERANCE(2e-3, 0.5); // the step is one part in 200
    TEST_ASSERT_TRUE(worst(low.modes, high.modes, down.modes, up.modes, scale, 2 * WIDE_MODES) < most);
    TEST_ASSERT_TRUE(worst(low.shapes, high.shapes, down.shapes, up.shapes, scale, 2 * WIDE_MODES * rig.n_y) < most);
    const int inputs_stay = method == OKID_METHOD_N4SID_MOESP || method == OKID_METHOD_N4SID_CVA;
    const double by_markov = worst(low.markov, high.markov, down.markov, up.markov, scale, MARKOV * n_u * rig.n_y);
    TEST_ASSERT_TRUE(inputs_stay || n_u == 0 || by_markov < most);
    okid_model_t none;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_jackknife_delete(s.jackknife, NULL, 1, &none, &share)); // no part, no change
    TEST_ASSERT_EQUAL_MEMORY(&down, &again, sizeof down); // what is asked in between leaves nothing behind
    free(more), free(less);
    setting_free(&s);
}

static void okid_of_several_channels(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 0.3);
        is_the_derivative(OKID_METHOD_OKID_ERA, rig.n_u);
        make(which, 1.5); // terms of second order in the noise show
        is_the_derivative(OKID_METHOD_OKID_ERA_DC, rig.n_u);
    }
}

static void subspace_methods_of_several_channels(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 3);
        for (int method = OKID_METHOD_N4SID_MOESP; method <= OKID_METHOD_N4SID_SSARX; ++method)
            is_the_derivative((okid_method_t)method, rig.n_u);
    }
}

static void without_forces(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 1);
        for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method)
            if (method != OKID_METHOD_N4SID_MOESP) is_the_derivative((okid_method_t)method, 0);
    }
}

/// Of sums with nothing left out: the full model again.
static void nothing_left_out_is_the_whole(void) {
    make(0, 0.3);
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method) {
        setting_t s = prepare((okid_method_t)method, rig.n_u);
        const printed_t whole = identified(&s, s.whole);
        okid_jackknife_config_t by_models = s.config;
        by_models.linear = 0;
        const size_t bytes = okid_jackknife_memsize(&by_models);
        void* block = malloc(bytes);
        okid_jackknife_t* jackknife = NULL;
        okid_model_t model;
        double share = -1;
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&jackknife, &by_models, block, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin(jackknife, s.whole, &s.full));
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(jackknife, NULL, 1, &model, &share));
        TEST_ASSERT_EQUAL_DOUBLE(0, share);
        const printed_t again = print_model(&s, &model);
        const double most = TOLERANCE(1e-4, 1e-2); // okid-era starts from the model, and comes near it
        for (int k = 0; k < 2 * WIDE_MODES; ++k) TEST_ASSERT_DOUBLE_WITHIN(most, whole.modes[k], again.modes[k]);
        for (int k = 0; k < MARKOV * rig.n_u * rig.n_y; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(10 * most, whole.markov[k], again.markov[k]);
        free(block);
        setting_free(&s);
    }
}

/// Where M, K, R are not asked for the subspace methods leave B and D alone: A and C are the same, to the bit.
static void modes_only_leave_the_inputs_alone(void) {
    make(0, 0.3);
    for (int method = OKID_METHOD_N4SID_MOESP; method <= OKID_METHOD_N4SID_SSARX; ++method) {
        setting_t s = prepare((okid_method_t)method, rig.n_u);
        identified(&s, s.whole);
        okid_model_t models[2];
        void* blocks[2];
        for (int only = 0; only < 2; ++only) {
            okid_jackknife_config_t config = s.config;
            config.linear = 0;
            config.modes_only = only;
            const size_t bytes = okid_jackknife_memsize(&config);
            okid_jackknife_t* jackknife = NULL;
            double share = 0;
            blocks[only] = malloc(bytes);
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&jackknife, &config, blocks[only], bytes));
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin(jackknife, s.whole, &s.full));
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(jackknife, s.part, 1, &models[only], &share));
            TEST_ASSERT_TRUE(share > 0 && share < 1);
        }
        const size_t n = (size_t)models[0].n_z, n_u = (size_t)rig.n_u, n_y = (size_t)rig.n_y;
        TEST_ASSERT_EQUAL(models[0].n_z, models[1].n_z);
        TEST_ASSERT_EQUAL_MEMORY(models[0].A, models[1].A, n * n * sizeof(okid_real_t));
        TEST_ASSERT_EQUAL_MEMORY(models[0].C, models[1].C, n_y * n * sizeof(okid_real_t));
        for (size_t k = 0; k < n * n_u; ++k) TEST_ASSERT_TRUE(models[1].B[k] == 0 && models[0].B[k] != 0);
        for (size_t k = 0; k < n_y * n_u; ++k) TEST_ASSERT_TRUE(models[1].D[k] == 0);
        free(blocks[0]), free(blocks[1]);
        setting_free(&s);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(okid_of_several_channels);
    RUN_TEST(subspace_methods_of_several_channels);
    RUN_TEST(without_forces);
    RUN_TEST(nothing_left_out_is_the_whole);
    RUN_TEST(modes_only_leave_the_inputs_alone);
    return UNITY_END();
}
