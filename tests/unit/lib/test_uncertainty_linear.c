// SPDX-License-Identifier: MIT
// The derivative of an identification along the sums of a part, against central differences of the identification itself:
// the record with the part twice, and without it. Nothing is shared with linear_*.cpp but the sums.
#include "derivative.h"
#include "tolerance.h"

#include <okid/steps/square_root.h>

enum { P = 20, N = 6000, FIRST = 2000, LAST = 2030 };

static rig_t rig;
static double *record, *outputs; // the same without the force

void setUp(void) {
    rig_make(&rig);
    record = rig_record(&rig, N, 0.05, NULL, 11);
    for (int n = 0; n < N; ++n) // offsets: the means of a part are not those of the whole
        for (int c = 0; c < RIG_M; ++c) record[n * RIG_M + c] += 3 + c;
    outputs = malloc(sizeof *outputs * N * RIG_NY);
    for (int n = 0; n < N; ++n) memcpy(outputs + n * RIG_NY, record + n * RIG_M + RIG_NU, RIG_NY * sizeof *outputs);
}
void tearDown(void) { free(record), free(outputs); }

/// Samples first .. last-1 of the record, or of its outputs alone.
static void feed(okid_accumulator_t* to, int n_u, int first, int last) {
    const double* from = n_u > 0 ? record + (size_t)first * RIG_M : outputs + (size_t)first * RIG_NY;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(to, from, (size_t)(last - first)));
}

static setting_t prepare(okid_method_t method, int n_u, okid_detrend_t detrend) {
    okid_identify_config_t c = {.n_u = n_u,
                                .n_y = RIG_NY,
                                .p = P,
                                .order = RIG_NZ,
                                .max_order = 8,
                                .fs_hz = RIG_FS,
                                .method = method,
                                .detrend = detrend};
    if (method >= OKID_METHOD_N4SID_MOESP) c.rows = P / 2, c.p = 0;
    setting_t s = setting_make(&c, rig_frequency);
    feed(s.whole, n_u, 0, N);
    feed(s.part, n_u, FIRST - s.config.sums.lags, LAST);
    return s;
}

static void the_change_is_the_derivative(void) {
    static const struct {
        okid_method_t method;
        int n_u;
    } cases[] = {{OKID_METHOD_OKID_ERA, RIG_NU},  {OKID_METHOD_OKID_ERA_DC, RIG_NU}, {OKID_METHOD_N4SID_MOESP, RIG_NU},
                 {OKID_METHOD_N4SID_CVA, RIG_NU}, {OKID_METHOD_N4SID_SSARX, RIG_NU}, {OKID_METHOD_N4SID_CVA, 0},
                 {OKID_METHOD_N4SID_SSARX, 0},    {OKID_METHOD_OKID_ERA, 0},         {OKID_METHOD_OKID_ERA_DC, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
        for (okid_detrend_t detrend = OKID_DETREND_NONE; detrend <= OKID_DETREND_MEAN; ++detrend) {
            if (detrend == OKID_DETREND_NONE)
                for (int n = 0; n < N * RIG_M; ++n) record[n] -= 3 + n % RIG_M;
            for (int n = 0; detrend == OKID_DETREND_NONE && n < N * RIG_NY; ++n) outputs[n] -= 4 + n % RIG_NY;
            setting_t s = prepare(cases[i].method, cases[i].n_u, detrend);
            okid_accumulator_t *more = setting_sums(&s), *less = setting_sums(&s);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(more, s.whole));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(more, s.part));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(less, s.whole));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(less, s.part, 1));
            const printed_t low = identified(&s, less), high = identified(&s, more);
            identified(&s, s.whole);
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
            double share = 0, ignored = 0;
            const printed_t down = changed(&s, 1, &share), up = changed(&s, -1, &ignored);
            const double scale = 1 - share; // the rest is smaller: what it says weighs more
            enum { OF_MODES = RIG_MODES, OF_SHAPES = RIG_MODES * RIG_NY };
            const double errors[] = {
                worst(low.modes, high.modes, down.modes, up.modes, scale, OF_MODES),
                worst(low.modes + OF_MODES, high.modes + OF_MODES, down.modes + OF_MODES, up.modes + OF_MODES, scale,
                      OF_MODES),
                worst(low.shapes, high.shapes, down.shapes, up.shapes, scale, OF_SHAPES),
                worst(low.shapes + OF_SHAPES, high.shapes + OF_SHAPES, down.shapes + OF_SHAPES, up.shapes + OF_SHAPES,
                      scale, OF_SHAPES),
                worst(low.markov, high.markov, down.markov, up.markov, scale, MARKOV * RIG_NY),
            };
            const int inputs_stay =
                cases[i].method == OKID_METHOD_N4SID_MOESP || cases[i].method == OKID_METHOD_N4SID_CVA;
            const int kinds = inputs_stay || cases[i].n_u == 0 ? 4 : 5;
            for (int k = 0; k < kinds; ++k) TEST_ASSERT_TRUE(errors[k] < TOLERANCE(0.01, 0.5)); // step: 1 part in 200
            free(more), free(less);
            setting_free(&s);
            if (detrend == OKID_DETREND_NONE)
                for (int n = 0; n < N * RIG_M; ++n) record[n] += 3 + n % RIG_M;
            for (int n = 0; detrend == OKID_DETREND_NONE && n < N * RIG_NY; ++n) outputs[n] += 4 + n % RIG_NY;
        }
}

/// Deviations of ten equal parts by derivatives and by identification without each are the same to a tenth.
static void deviations_are_those_of_the_jackknife(void) {
    enum { PARTS = 10 };
    static const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_CVA};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; ++i) {
        setting_t s = prepare(methods[i], RIG_NU, OKID_DETREND_MEAN);
        const int lags = s.config.sums.lags;
        identified(&s, s.whole);
        const okid_model_t full = full_model(&s);
        const okid_replicates_config_t modes_only = okid_replicates_defaults(RIG_NU, RIG_NY, 8);
        double found[2][2 * RIG_MODES];
        for (int linear = 0; linear < 2; ++linear) {
            s.config.linear = linear;
            const size_t bytes = okid_jackknife_memsize(&s.config), size = okid_replicates_memsize(&modes_only);
            void *block = malloc(bytes), *sums = malloc(size);
            okid_replicates_t* replicates = NULL;
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&s.jackknife, &s.config, block, bytes));
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&replicates, &modes_only, sums, size));
            TEST_ASSERT_EQUAL(OKID_OK, linear ? okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full)
                                              : okid_jackknife_begin(s.jackknife, s.whole, &s.full));
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(replicates, &full, 1 / RIG_FS));
            for (int k = 0; k < PARTS; ++k) {
                const int first = lags + k * (N - lags) / PARTS, last = lags + (k + 1) * (N - lags) / PARTS;
                okid_accumulator_reset(s.part);
                feed(s.part, RIG_NU, first - lags, last);
                okid_model_t model;
                double share = 0;
                TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, 1, &model, &share));
                TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_add(replicates, &model, share));
            }
            okid_uncertainty_t out;
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_finish(replicates, &out));
            for (int k = 0; k < RIG_MODES; ++k) {
                found[linear][k] = out.frequency_std_hz[k];
                found[linear][RIG_MODES + k] = out.damping_ratio_std[k];
            }
            free(block), free(sums);
        }
        for (int k = 0; k < 2 * RIG_MODES; ++k) TEST_ASSERT_TRUE(fabs(found[1][k] / found[0][k] - 1) < 0.1);
        setting_free(&s);
    }
}

/// A part with a gap in it goes another way to its Gram matrix.
static void a_gap_changes_nothing(void) {
    setting_t s = prepare(OKID_METHOD_N4SID_CVA, RIG_NU, OKID_DETREND_MEAN);
    const int lags = s.config.sums.lags, middle = (FIRST + LAST) / 2;
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    double share = 0;
    const printed_t one = changed(&s, 1, &share);
    okid_accumulator_reset(s.part);
    feed(s.part, RIG_NU, FIRST - lags, middle);
    okid_accumulator_gap(s.part, 0);
    feed(s.part, RIG_NU, middle - lags, LAST);
    const printed_t other = changed(&s, 1, &share);
    for (int k = 0; k < RIG_MODES; ++k) {
        const double limit = TOLERANCE(1e-9, 1e-4);
        TEST_ASSERT_TRUE(fabs(other.modes[k] / one.modes[k] - 1) < limit);
        TEST_ASSERT_TRUE(fabs(other.modes[RIG_MODES + k] / one.modes[RIG_MODES + k] - 1) < 100 * limit);
    }
    setting_free(&s);
}

static void what_has_no_derivative_is_refused(void) {
    setting_t s = prepare(OKID_METHOD_OKID_ERA, RIG_NU, OKID_DETREND_MEAN);
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_jackknife_begin(s.jackknife, s.whole, &s.full));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_jackknife_begin_linear(s.jackknife, NULL, s.whole, &s.full));
    okid_identified_t larger = s.full;
    larger.n_z = 100;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &larger));
    okid_square_root_config_t shape = {.n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .forgetting = 1};
    const size_t bytes = okid_square_root_memsize(&shape);
    void* block = malloc(bytes);
    okid_square_root_t* factor = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&factor, &shape, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(factor, record, N));
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run_factor(s.identify, factor, &s.full));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    free(block);
    okid_jackknife_config_t none = s.config;
    none.identify.hankel = OKID_HANKEL_INNOVATIONS;
    TEST_ASSERT_EQUAL(0, okid_jackknife_memsize(&none));
    setting_free(&s);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_change_is_the_derivative);
    RUN_TEST(deviations_are_those_of_the_jackknife);
    RUN_TEST(a_gap_changes_nothing);
    RUN_TEST(what_has_no_derivative_is_refused);
    return UNITY_END();
}
