// SPDX-License-Identifier: MIT
// Which poles are modes, in which order, and which entry of a shape is the 1: okid_modal_analyse() and
// okid_mkr_identify() by the same rule.
#include "mkr_rig.h"

#include <okid/modal.h>

enum { NY = 2, PAIRS = 2, NZ = 2 * PAIRS };

static okid_real_t A[NZ * NZ], B[NZ], C[NY * NZ], D[NY];
static okid_real_t f[PAIRS], zeta[PAIRS], re[NY * PAIRS], im[NY * PAIRS], mpc[PAIRS], mu_re[PAIRS], mu_im[PAIRS];
static okid_modes_t modes;

void setUp(void) {
    memset(A, 0, sizeof A);
    memset(B, 0, sizeof B);
    memset(C, 0, sizeof C);
}
void tearDown(void) {}

/// Pair k of the model turns by `angle` and shrinks to `radius` a sample; outputs see its first state by c.
static void put_pair(int k, int n_z, double radius, double angle, double c0, double c1) {
    const int i = 2 * k, j = i + 1;
    A[i * n_z + i] = A[j * n_z + j] = (okid_real_t)(radius * cos(angle));
    A[i * n_z + j] = (okid_real_t)(radius * sin(angle));
    A[j * n_z + i] = -A[i * n_z + j];
    B[i] = 1;
    C[i * NY] = (okid_real_t)c0;
    C[i * NY + 1] = (okid_real_t)c1;
}

static okid_model_t view(int n_z) {
    const okid_model_t model = {1, NY, n_z, A, B, C, D, NULL};
    return model;
}

static void analyse(int n_z, double dt) {
    const okid_model_t model = view(n_z);
    const size_t bytes = okid_modal_memsize(NY, n_z);
    void* work = malloc(bytes);
    modes = (okid_modes_t){.frequency_hz = f,
                           .damping_ratio = zeta,
                           .mpc = mpc,
                           .shape_re = re,
                           .shape_im = im,
                           .mu_re = mu_re,
                           .mu_im = mu_im};
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, dt, &modes, work, bytes));
    free(work);
}

/// How many modes okid_mkr_identify() finds for one degree of freedom, by its result or its error.
static int admissible(int n_z) {
    const int32_t dof[NY] = {0, -1}, sensing[NY] = {OKID_SENSE_DISPLACEMENT, OKID_SENSE_DISPLACEMENT};
    okid_mkr_config_t config = okid_mkr_defaults(1, 0.01);
    config.input_dof = config.output_dof = dof;
    config.output_sensing = sensing;
    const okid_model_t model = view(n_z);
    const size_t bytes = okid_mkr_memsize(1, NY, n_z, 1);
    TEST_ASSERT_TRUE(bytes <= sizeof mkr_block);
    const okid_status_t status = okid_mkr_identify(&model, &config, &result, &mkr_block, bytes);
    TEST_ASSERT_EQUAL(result.admissible == 0, status == OKID_ERR_NO_MODES);
    return result.admissible;
}

// 0 < zeta < 1 below Nyquist: |mu| < 1, an angle up to 0.99 pi, |log mu| up to pi.
static void a_mode_is_damped_and_below_nyquist(void) {
    const double dt = 0.01;
    for (double radius = 0.05; radius < 1.2; radius += radius < 0.9 ? 0.05 : 0.0095)
        for (int step = 1; step < 400; step += step < 380 ? 13 : 1) {
            const double angle = RIG_PI * step / 400, size = hypot(log(radius), angle);
            const int mode = radius < 1 && angle <= 0.99 * RIG_PI && size <= RIG_PI;
            if (fabs(angle / RIG_PI - 0.99) < 1e-9 || fabs(size - RIG_PI) < 1e-6) continue;
            put_pair(0, 2, radius, angle, 1, 0);
            analyse(2, dt);
            TEST_ASSERT_EQUAL_INT32(mode, modes.count);
            TEST_ASSERT_EQUAL_INT32(mode, admissible(2));
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, radius, modes.radius);
            if (!mode) continue;
            TEST_ASSERT_DOUBLE_WITHIN(1e-5 * size, size, 2 * RIG_PI * dt * (double)f[0]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, -log(radius) / size, zeta[0]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, radius * cos(angle), mu_re[0]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, radius * sin(angle), mu_im[0]);
        }
}

static void of_entries_of_one_size_the_first_is_one(void) {
    put_pair(0, 2, 0.9, 1, 1, -1); // the second output is the first reversed, to the bit
    analyse(2, 0.01);
    TEST_ASSERT_EQUAL_INT32(1, modes.count);
    TEST_ASSERT_EQUAL_DOUBLE(1, re[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0, im[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -1, re[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, im[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, mpc[0]);
}

static void the_largest_entry_is_one_wherever_it_stands(void) {
    for (int first = 0; first < 2; ++first) {
        put_pair(0, 2, 0.9, 1, first ? 3 : 0.5, first ? 0.5 : 3);
        analyse(2, 0.01);
        TEST_ASSERT_EQUAL_DOUBLE(1, re[first ? 0 : 1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0 / 6, re[first ? 1 : 0]);
    }
}

static void a_mode_that_no_output_sees_has_no_shape(void) {
    put_pair(0, 2, 0.9, 1, 0, 0);
    analyse(2, 0.01);
    TEST_ASSERT_EQUAL_INT32(1, modes.count);
    for (int o = 0; o < NY; ++o) TEST_ASSERT_EQUAL_DOUBLE(0, hypot(re[o], im[o]));
    TEST_ASSERT_EQUAL_DOUBLE(0, mpc[0]);
}

static void modes_ascend_in_frequency_not_in_angle(void) {
    for (int swap = 0; swap < 2; ++swap) {
        put_pair(swap, NZ, 0.4, 1.0, 1, 0);  // |log mu| = 1.36
        put_pair(!swap, NZ, 0.9, 1.2, 0, 1); // 1.20
        analyse(NZ, 0.01);
        TEST_ASSERT_EQUAL_INT32(2, modes.count);
        TEST_ASSERT_TRUE(f[0] < f[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, re[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, re[NY]);
    }
}

// Two equal masses on equal springs, tied to nothing else: poles equal to the bit. `mode` tells which is which.
static void equal_poles_stand_in_one_order_in_both_lists(void) {
    const int32_t dof[] = {0, 1}, kind[] = {OKID_SENSE_DISPLACEMENT, OKID_SENSE_DISPLACEMENT};
    static structure_t s;
    static system_t m;
    s.n = 2;
    s.M[0] = s.M[3] = 1;
    s.K[0] = s.K[3] = 100;
    s.R[0] = s.R[3] = (okid_real_t)0.2;
    s.dt = 0.05;
    s.omega[0] = s.omega[1] = 10;
    s_instrument(&m, 2, dof, 2, dof, kind);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 2, OKID_HOLD_ZERO));
    memcpy(A, m.A, sizeof A);
    memcpy(C, m.C, sizeof C);
    analyse(NZ, m.dt);
    TEST_ASSERT_EQUAL_INT32(2, modes.count);
    for (int k = 0; k < 2; ++k) {
        const int at = NY * result.mode[k];
        TEST_ASSERT_EQUAL_INT32(k, result.mode[k]);
        const double likeness =
            okid_modal_mac(NY, re + at, im + at, result.W_re + (ptrdiff_t)NY * k, result.W_im + (ptrdiff_t)NY * k);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, likeness);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(a_mode_is_damped_and_below_nyquist);
    RUN_TEST(of_entries_of_one_size_the_first_is_one);
    RUN_TEST(the_largest_entry_is_one_wherever_it_stands);
    RUN_TEST(a_mode_that_no_output_sees_has_no_shape);
    RUN_TEST(modes_ascend_in_frequency_not_in_angle);
    RUN_TEST(equal_poles_stand_in_one_order_in_both_lists);
    return UNITY_END();
}
