// SPDX-License-Identifier: MIT
// Outputs that show what was there earlier, under a held force: the step of the force reaches them one sample late, by a
// state of its own in the model. Delay, C and D come back.
#include "structures.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <okid/steps/skew.h>
#include <unity.h>

enum { N_Z = 7, REPLICATES = 6 };
static const double share[3] = {0.04, 0, 0.1}; // of a sample: so much earlier

static structure_t s;
static system_t truth;

void setUp(void) {
    static const int32_t force = 0, dofs[3] = {0, 1, 2}, kinds[3] = {2, 2, 2};
    s_make(&s, 1);
    s_instrument(&truth, 1, &force, 3, dofs, kinds);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &truth));
}
void tearDown(void) {}

/// A zero-order-hold model whose output o shows t - times[o]: C e^(-A t) x_k + (D - C int_0^t e^(-A s) ds B) u_(k-1). The
/// last state is u_(k-1).
static void behind(const double* times, system_t* out) {
    system_t sampled = truth;
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&sampled, OKID_HOLD_ZERO));
    *out = sampled;
    out->n_z = N_Z;
    memset(out->A, 0, sizeof out->A);
    memset(out->B, 0, sizeof out->B);
    memset(out->C, 0, sizeof out->C);
    for (int j = 0; j < 6; ++j) {
        for (int i = 0; i < 6; ++i) out->A[j * N_Z + i] = sampled.A[j * 6 + i];
        out->B[j] = sampled.B[j];
    }
    out->B[6] = 1;
    for (int o = 0; o < 3; ++o) {
        system_t step = truth;
        for (int i = 0; i < 36; ++i) step.A[i] = -step.A[i];
        for (int i = 0; i < 6; ++i) step.B[i] = -step.B[i];
        step.dt = times[o] > 0 ? times[o] : s.dt;
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&step, OKID_HOLD_ZERO));
        for (int j = 0; j < 6; ++j) {
            double sum = times[o] > 0 ? 0 : (double)truth.C[j * 3 + o];
            for (int k = 0; times[o] > 0 && k < 6; ++k) sum += (double)truth.C[k * 3 + o] * (double)step.A[j * 6 + k];
            out->C[j * 3 + o] = (okid_real_t)sum;
        }
        if (times[o] <= 0) continue;
        double d = (double)truth.D[o];
        for (int k = 0; k < 6; ++k) d += (double)truth.C[k * 3 + o] * (double)step.B[k];
        out->C[6 * 3 + o] = (okid_real_t)d;
        out->D[o] = 0;
    }
}

static void the_step_of_the_force_is_taken_back_into_d(void) {
    static unsigned char block[1 << 18];
    static system_t late, other;
    double times[3], each[3];
    for (int o = 0; o < 3; ++o) times[o] = share[o] * s.dt;
    behind(times, &late);
    const okid_mkr_config_t mkr = {3,    OKID_HOLD_ZERO,  late.dt, late.input_dof,
                                   NULL, late.output_dof, NULL,    late.sensing};
    const okid_skew_config_t config = {1, 3, N_Z, REPLICATES, &mkr};
    okid_skew_t* self = NULL;
    TEST_ASSERT_TRUE(okid_skew_memsize(&config) <= sizeof block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_create(&self, &config, block, sizeof block));
    const okid_model_t full = s_view(&late);
    TEST_ASSERT_TRUE(okid_skew_begin(self, &full) >= 0);
    for (int r = 0; r < REPLICATES; ++r) {
        for (int o = 0; o < 3; ++o) each[o] = times[o] > 0 ? times[o] + ((r + o) % 2 ? 1e-3 : -1e-3) * s.dt : 0;
        behind(each, &other);
        const okid_model_t one = s_view(&other);
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_add(self, &one));
    }
    okid_skew_result_t found;
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_finish(self, &found));
    for (int o = 0; o < 3; ++o) {
        TEST_ASSERT_TRUE(fabs(found.delay[o] / s.dt - share[o]) < 1e-8);
        TEST_ASSERT_EQUAL(share[o] > 0, found.late[o]);
    }
    okid_real_t C[3 * N_Z], D[3];
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_correct(self, C, D));
    TEST_ASSERT_TRUE(s_error(late.C, truth.C, 18) > 1e-3 && fabs((double)truth.D[0]) > 0.1);
    TEST_ASSERT_TRUE(s_error(C, truth.C, 18) < 1e-8);
    for (int o = 0; o < 3; ++o) {
        TEST_ASSERT_TRUE(fabs((double)C[18 + o]) < 1e-8);
        TEST_ASSERT_TRUE(fabs((double)D[o] - (double)truth.D[o]) < 1e-8);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_step_of_the_force_is_taken_back_into_d);
    return UNITY_END();
}
