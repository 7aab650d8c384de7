// SPDX-License-Identifier: MIT
// Mass, damping and stiffness from exact models: any sensing, any places, any realization; what cannot be done is refused.
#include "mkr_rig.h"

static structure_t s;
static system_t m;

void setUp(void) {}
void tearDown(void) {}

static void every_structure_sensing_and_hold(void) {
    for (int which = 1; which <= 3; ++which)
        for (int kind = 0; kind < 4; ++kind)
            for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold)
                for (uint64_t seed = 1; seed <= 3; ++seed) {
                    mkr_standard(&s, &m, which, kind, hold, seed);
                    TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, s.n, hold));
                    assert_exact(&s);
                    TEST_ASSERT_EQUAL(0, result.notes);
                    TEST_ASSERT_EQUAL(s.n, result.admissible);
                    TEST_ASSERT_EQUAL(which, result.pairs);
                    TEST_ASSERT_TRUE(result.residual < TOLERANCE(1e-12, 1e-3));
                    TEST_ASSERT_TRUE(result.feedthrough < TOLERANCE(1e-12, 1e-2));
                    for (int k = 0; k < s.n; ++k) {
                        const double omega = 2 * RIG_PI * result.frequency_hz[k];
                        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 2e-4), s.alpha / (2 * omega) + s.beta * omega / 2,
                                                  result.damping_ratio[k]);
                        TEST_ASSERT_TRUE(result.mpc[k] > TOLERANCE(1 - 1e-12, 1 - 1e-4));
                        TEST_ASSERT_TRUE(fabs(result.phase[k]) < TOLERANCE(1e-12, 1e-3));
                        TEST_ASSERT_TRUE(result.pair_spread[k] < TOLERANCE(1e-11, 1e-2));
                    }
                    if (kind == OKID_SENSE_ACCELERATION)
                        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-3), 1, result.gain);
                    if (kind < OKID_SENSE_ACCELERATION) TEST_ASSERT_EQUAL_DOUBLE(0, result.gain);
                }
}

// Every degree of freedom has a force or a sensor, not both; a single pair ties them.
static void degrees_of_freedom_with_only_an_actuator(void) {
    const int32_t all[] = {0, 1, 2, 3, 4, 5}, two[] = {4, 2}, forces[] = {4, 1, 0}, sensors[] = {5, 0, 3, 2};
    const int32_t kinds[] = {2, 0, 1, 2};
    for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold) {
        s_make(&s, 2);
        mkr_system(&s, &m, 6, all, 2, two, kinds, hold, 7); // forces everywhere, two sensors
        TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 6, hold));
        TEST_ASSERT_EQUAL(2, result.pairs);
        assert_exact(&s);
        mkr_system(&s, &m, 3, forces, 4, sensors, kinds, hold, 8); // 1 and 4 driven only, 0 both, the others sensed
        TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 6, hold));
        TEST_ASSERT_EQUAL(1, result.pairs);
        assert_exact(&s);
    }
}

// Several sensors on one degree of freedom, several co-located pairs, channels that belong to none of them.
static void spare_channels_and_many_pairs(void) {
    const int32_t forces[] = {0, 2, 2, 1}, sensors[] = {0, 0, 1, 2, 2, 1}, kinds[] = {0, 2, 1, 2, 1, 2};
    s_make(&s, 1);
    mkr_system(&s, &m, 4, forces, 6, sensors, kinds, OKID_HOLD_ZERO, 4);
    TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(8, result.pairs);
    assert_exact(&s);
    m.output_dof[5] = m.output_dof[4] = m.input_dof[3] = -1;
    TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(4, result.pairs);
    assert_exact(&s);
}

static void flipped_and_scaled_channels(void) {
    const int32_t forces[] = {0, 3}, sensors[] = {0, 1, 2, 3, 4, 5}, kinds[] = {2, 2, 0, 1, 2, 2};
    for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold) {
        s_make(&s, 2);
        s_instrument(&m, 2, forces, 6, sensors, kinds);
        m.input_gain[1] = -2;
        m.output_gain[0] = -1;
        m.output_gain[3] = (okid_real_t)0.25;
        m.output_gain[4] = -3;
        TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, hold));
        s_scramble(&m, 3);
        TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 6, hold));
        assert_exact(&s);
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-3), 1, result.gain);
    }
}

// Damping that is not proportional: complex modes. R is exact all the same, R_normal cannot be.
static void damping_of_any_kind(void) {
    const int32_t forces[] = {0, 2}, sensors[] = {0, 1, 2}, kinds[] = {2, 2, 2};
    s_make(&s, 1);
    s.R[4] += 20; // a dashpot from the second mass to ground
    mkr_system(&s, &m, 2, forces, 3, sensors, kinds, OKID_HOLD_ZERO, 5);
    const okid_status_t status = mkr_run(&m, 3, OKID_HOLD_ZERO);
    TEST_ASSERT_TRUE(status >= 0);
    TEST_ASSERT_TRUE(error_M(&s) < TOLERANCE(1e-12, 1e-3));
    TEST_ASSERT_TRUE(error_K(&s) < TOLERANCE(1e-12, 1e-3));
    TEST_ASSERT_TRUE(error_R(&s) < TOLERANCE(1e-12, 1e-3));
    TEST_ASSERT_TRUE(error_normal(&s) > 0.05);
    TEST_ASSERT_TRUE(result.residual < TOLERANCE(1e-13, 1e-5)); // zero in the sum, no longer mode by mode
    TEST_ASSERT_TRUE(result.mpc[1] < 0.9999);
}

/// The system with poles a noisy over-ordered model has: fast, slow, badly damped, unstable, beyond and near Nyquist, real.
static void add_noise_poles(double size) {
    static const double poles[][2] = {{0.9, 1.3},   {0.7, 0.4}, {0.97, 2.8}, {1.01, 0.9},
                                      {0.95, 3.13}, {0.5, 0},   {-0.6, 0},   {0.999, 0.05}};
    uint64_t seed = 77;
    for (size_t k = 0; k < sizeof poles / sizeof *poles; ++k) s_add_pole(&m, poles[k][0], poles[k][1], size, &seed);
    for (int k = 0; k < 4; ++k) s_reflect(&m, &seed);
}

static void over_order_picks_the_modes_of_the_structure(void) {
    for (int which = 1; which <= 3; ++which)
        for (int kind = 0; kind < 4; ++kind) {
            mkr_standard(&s, &m, which, kind, OKID_HOLD_ZERO, 2);
            add_noise_poles(1e-3);
            const okid_status_t status = mkr_run(&m, s.n, OKID_HOLD_ZERO);
            TEST_ASSERT_EQUAL(OKID_OK, status);
            TEST_ASSERT_EQUAL(s.n + 4, result.admissible); // the unstable one and the one near Nyquist are no modes
            assert_exact(&s);
            TEST_ASSERT_TRUE(result.margin > 2);
            okid_real_t f[S_NZ / 2];
            const size_t bytes = okid_modal_memsize(m.n_y, m.n_z);
            void* work = malloc(bytes);
            const okid_model_t model = {.n_u = m.n_u, .n_y = m.n_y, .n_z = m.n_z, .A = m.A, .C = m.C};
            okid_modes_t modes = {.frequency_hz = f};
            TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, m.dt, &modes, work, bytes));
            TEST_ASSERT_EQUAL(modes.count, result.admissible);
            for (int k = 0; k < s.n; ++k) // `mode` is the place in that list
                TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-10, 1e-3) * f[result.mode[k]], f[result.mode[k]],
                                          result.frequency_hz[k]);
            free(work);
        }
}

// The choice does not depend on units: of forces, of sensors, of one channel alone.
static void the_choice_is_free_of_units(void) {
    mkr_standard(&s, &m, 2, 2, OKID_HOLD_ZERO, 2);
    add_noise_poles(1e-3);
    for (int j = 0; j < m.n_z; ++j) m.C[j * m.n_y + 4] *= 1000;
    for (int j = 0; j < m.n_u; ++j) m.D[j * m.n_y + 4] *= 1000;
    for (int i = 0; i < m.n_z; ++i) m.B[m.n_z + i] *= (okid_real_t)1e-4;
    for (int o = 0; o < m.n_y; ++o) m.D[m.n_y + o] *= (okid_real_t)1e-4;
    m.output_gain[4] = 1000;
    m.input_gain[1] = (okid_real_t)1e-4;
    TEST_ASSERT_EQUAL(OKID_OK, mkr_run(&m, 6, OKID_HOLD_ZERO));
    assert_exact(&s);
}

// Noise poles grow until one of them pushes a mode out: before that the choice is noted as close and still right, after
// it the checks find the wrong mode out.
static void a_near_thing_is_noted_and_a_wrong_mode_found_out(void) {
    int close = 0;
    double size = 0.01;
    for (; size < 100; size *= 1.1) {
        mkr_standard(&s, &m, 1, 2, OKID_HOLD_ZERO, 2);
        add_noise_poles(size);
        const okid_status_t status = mkr_run(&m, 3, OKID_HOLD_ZERO);
        if (!(error_M(&s) < 1e-2)) break;
        TEST_ASSERT_EQUAL(result.margin < 2 ? OKID_WARN_MODEL : OKID_OK, status);
        TEST_ASSERT_EQUAL(result.margin < 2 ? OKID_MKR_CLOSE : 0, result.notes);
        close += result.margin < 2;
        assert_exact(&s);
    }
    TEST_ASSERT_TRUE(close >= 2);
    TEST_ASSERT_TRUE(size < 100);
    TEST_ASSERT_TRUE(result.notes & OKID_MKR_FEEDTHROUGH);
    TEST_ASSERT_TRUE(result.notes & OKID_MKR_RESIDUAL);
}

static void missing_instruments_are_named(void) {
    const int32_t forces[] = {0}, sensors[] = {0, 2}, apart[] = {1, 2}, kinds[] = {2, 2};
    s_make(&s, 1);
    mkr_system(&s, &m, 1, forces, 2, sensors, kinds, OKID_HOLD_ZERO, 1);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(1, result.dof); // the second mass has nothing
    TEST_ASSERT_NULL(result.M);
    mkr_system(&s, &m, 1, forces, 2, apart, kinds, OKID_HOLD_ZERO, 1);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(-1, result.dof); // all have one, none has both
    TEST_ASSERT_EQUAL(0, result.pairs);
}

static void wrong_use_is_refused(void) {
    mkr_standard(&s, &m, 1, 2, OKID_HOLD_ZERO, 1);
    const okid_model_t view = s_view(&m);
    okid_mkr_config_t c = {3, 0, m.dt, m.input_dof, NULL, m.output_dof, NULL, m.sensing};
    const size_t bytes = okid_mkr_memsize(1, 3, 6, 3);
    TEST_ASSERT_EQUAL(OKID_OK, okid_mkr_identify(&view, &c, &result, &mkr_block, bytes));
    assert_exact(&s);
    TEST_ASSERT_EQUAL(0, okid_mkr_memsize(1, 3, 6, 0));
    TEST_ASSERT_EQUAL(0, okid_mkr_memsize(0, 3, 6, 3));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mkr_identify(&view, &c, &result, &mkr_block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mkr_identify(NULL, &c, &result, &mkr_block, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mkr_identify(&view, NULL, &result, &mkr_block, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mkr_identify(&view, &c, NULL, &mkr_block, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mkr_identify(&view, &c, &result, NULL, bytes));
    const okid_real_t zero[] = {0, 1, 1};
    const int32_t far[] = {0, 3, 1}, below[] = {0, -2, 1}, no_kind[] = {2, 2, 3};
    okid_mkr_config_t bad[10];
    for (int i = 0; i < 10; ++i) bad[i] = c;
    bad[0].n_x = 0;
    bad[1].dt = 0;
    bad[2].dt = NAN;
    bad[3].hold = 2;
    bad[4].output_dof = far;
    bad[5].output_dof = below;
    bad[6].output_sensing = no_kind;
    bad[7].output_gain = zero;
    bad[8].input_gain = zero;
    bad[9].input_dof = far + 1;
    for (int i = 0; i < 10; ++i)
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mkr_identify(&view, &bad[i], &result, &mkr_block, sizeof mkr_block));
    c.output_sensing = NULL;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mkr_identify(&view, &c, &result, &mkr_block, bytes));
}

static void numbers_that_are_none_are_refused(void) {
    mkr_standard(&s, &m, 1, 2, OKID_HOLD_ZERO, 1);
    m.A[4] = (okid_real_t)NAN;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_NULL(result.M);
    mkr_standard(&s, &m, 1, 2, OKID_HOLD_ZERO, 1);
    for (int j = 0; j < m.n_z; ++j) m.C[j * m.n_y] = 0; // the sensor of the pair is dead
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, mkr_run(&m, 3, OKID_HOLD_ZERO));
    TEST_ASSERT_NULL(result.M);
}

static void every_note_has_a_name(void) {
    for (uint32_t bit = OKID_MKR_POLARITY; bit <= OKID_MKR_CLOSE; bit <<= 1) {
        TEST_ASSERT_NOT_NULL(okid_mkr_note(bit));
        for (uint32_t other = OKID_MKR_POLARITY; other < bit; other <<= 1)
            TEST_ASSERT_TRUE(strcmp(okid_mkr_note(bit), okid_mkr_note(other)) != 0);
    }
    TEST_ASSERT_NULL(okid_mkr_note(OKID_MKR_CLOSE << 1));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(every_structure_sensing_and_hold);
    RUN_TEST(degrees_of_freedom_with_only_an_actuator);
    RUN_TEST(spare_channels_and_many_pairs);
    RUN_TEST(flipped_and_scaled_channels);
    RUN_TEST(damping_of_any_kind);
    RUN_TEST(over_order_picks_the_modes_of_the_structure);
    RUN_TEST(the_choice_is_free_of_units);
    RUN_TEST(a_near_thing_is_noted_and_a_wrong_mode_found_out);
    RUN_TEST(missing_instruments_are_named);
    RUN_TEST(wrong_use_is_refused);
    RUN_TEST(numbers_that_are_none_are_refused);
    RUN_TEST(every_note_has_a_name);
    return UNITY_END();
}
