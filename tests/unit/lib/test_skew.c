// SPDX-License-Identifier: MIT
// Delays of the outputs from the phases of the modes: found, taken out of C and D, and left alone where modes are complex.
#include "structures.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <okid/steps/skew.h>
#include <unity.h>

enum { REPLICATES = 8 };
static const double share[3] = {0.02, 0.05, 0.1}; // of a sample: output k is taken so much later than its stamp
static const double limit = TOLERANCE(1e-9, 2e-3);

static structure_t s;
static system_t truth, late;
static okid_skew_result_t found;
static okid_mkr_config_t mkr;
static okid_skew_t* self;
static unsigned char block[1 << 18];

/// W1, all accelerations, `extra` N s/m more between mass 1 and the ground.
static void make(double extra) {
    static const int32_t force = 0, dofs[3] = {0, 1, 2}, kinds[3] = {2, 2, 2};
    s_make(&s, 1);
    s.R[0] += (okid_real_t)extra;
    s_instrument(&truth, 1, &force, 3, dofs, kinds);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &truth));
    truth.dt = s.dt;
}

/// The rows of a model sampled `times[o]` seconds after the stamp: C e^(A t), D + C times the integral of e^(A t) B.
static void delay(const system_t* continuous, const double* times, system_t* out) {
    *out = *continuous;
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(out, OKID_HOLD_ZERO));
    for (int o = 0; o < 3; ++o) {
        system_t step = *continuous;
        if (times[o] == 0) continue;
        step.dt = times[o];
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&step, OKID_HOLD_ZERO));
        double d = (double)continuous->D[o];
        for (int k = 0; k < 6; ++k) d += (double)continuous->C[k * 3 + o] * (double)step.B[k];
        out->D[o] = (okid_real_t)d;
        for (int j = 0; j < 6; ++j) {
            double sum = 0;
            for (int k = 0; k < 6; ++k) sum += (double)continuous->C[k * 3 + o] * (double)step.A[j * 6 + k];
            out->C[j * 3 + o] = (okid_real_t)sum;
        }
    }
}

static void create(void) {
    mkr = (okid_mkr_config_t){3, OKID_HOLD_ZERO, late.dt, late.input_dof, NULL, late.output_dof, NULL, late.sensing};
    const okid_skew_config_t config = {1, 3, 6, REPLICATES, &mkr};
    const size_t bytes = okid_skew_memsize(&config);
    TEST_ASSERT_TRUE(bytes > 0 && bytes <= sizeof block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_create(&self, &config, block, sizeof block));
}

/// Output k `scale` share[k] samples later, replicates that scatter by 1e-3 samples.
static okid_status_t look(double scale) {
    double times[3], each[3];
    for (int o = 0; o < 3; ++o) times[o] = scale * share[o] * s.dt;
    delay(&truth, times, &late);
    create();
    const okid_model_t full = s_view(&late);
    TEST_ASSERT_TRUE(okid_skew_begin(self, &full) >= 0);
    for (int r = 0; r < REPLICATES; ++r) {
        system_t other;
        for (int o = 0; o < 3; ++o) each[o] = times[o] + ((r + o) % 2 ? 1e-3 : 2e-3) * s.dt;
        delay(&truth, each, &other);
        const okid_model_t one = s_view(&other);
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_add(self, &one));
    }
    return okid_skew_finish(self, &found);
}

void setUp(void) { make(0); }
void tearDown(void) {}

static void delays_are_found_and_taken_out(void) {
    TEST_ASSERT_EQUAL(OKID_OK, look(1));
    for (int o = 0; o < 3; ++o) {
        TEST_ASSERT_TRUE(fabs(found.delay[o] / s.dt + share[o]) < limit);
        TEST_ASSERT_TRUE(found.std[o] > 0 && found.std[o] < 0.01 * s.dt);
        TEST_ASSERT_EQUAL(1, found.late[o]);
        TEST_ASSERT_EQUAL(0, found.too_large[o]);
    }
    TEST_ASSERT_EQUAL(3, found.corrected);
    okid_real_t C[18], D[3];
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_correct(self, C, D));
    TEST_ASSERT_TRUE(s_error(late.C, truth.C, 18) > 1e-3);
    TEST_ASSERT_TRUE(s_error(C, truth.C, 18) < limit);
    for (int o = 0; o < 3; ++o) TEST_ASSERT_TRUE(fabs((double)D[o] - (double)truth.D[o]) < limit);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_skew_correct(self, C, D)); // once
}

static void nothing_late_nothing_done(void) {
    TEST_ASSERT_EQUAL(OKID_OK, look(0));
    TEST_ASSERT_EQUAL(0, found.corrected);
    TEST_ASSERT_EQUAL(0, found.undetermined);
    TEST_ASSERT_TRUE(found.scatter < 1);
}

static void more_than_is_believed_is_not_corrected(void) {
    TEST_ASSERT_EQUAL(OKID_OK, look(4)); // 0.08, 0.2 and 0.4 samples
    TEST_ASSERT_EQUAL(2, found.corrected);
    TEST_ASSERT_EQUAL(1, found.too_large[2]);
    TEST_ASSERT_EQUAL(0, found.late[2]);
}

static void complex_modes_leave_them_undetermined(void) {
    make(20);
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, look(1));
    TEST_ASSERT_EQUAL(1, found.undetermined);
    TEST_ASSERT_EQUAL(0, found.corrected);
    okid_real_t C[18], D[3];
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_correct(self, C, D));
    TEST_ASSERT_TRUE(s_error(C, late.C, 18) < limit);
}

static void wrong_use_is_refused(void) {
    look(0);
    okid_skew_config_t config = {1, 3, 6, REPLICATES, &mkr};
    okid_model_t model = s_view(&late);
    create();
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_skew_add(self, &model));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_skew_finish(self, &found));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_skew_begin(self, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_skew_finish(self, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_skew_correct(self, NULL, NULL));
    TEST_ASSERT_TRUE(okid_skew_begin(self, &model) >= 0);
    for (int r = 0; r < REPLICATES; ++r) TEST_ASSERT_EQUAL(OKID_OK, okid_skew_add(self, &model));
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_skew_add(self, &model));
    model.n_z = 4;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_skew_begin(self, &model));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_skew_create(&self, &config, block, 100));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_skew_create(&self, &config, NULL, 100));
    config.replicates = 1;
    TEST_ASSERT_EQUAL(0, okid_skew_memsize(&config));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_skew_create(&self, &config, block, sizeof block));
    TEST_ASSERT_EQUAL(0, okid_skew_memsize(NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(delays_are_found_and_taken_out);
    RUN_TEST(nothing_late_nothing_done);
    RUN_TEST(more_than_is_believed_is_not_corrected);
    RUN_TEST(complex_modes_leave_them_undetermined);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
