// SPDX-License-Identifier: MIT
// The remarks on an observer stand exactly where the numbers beside them say so, from every source of sums.
#include "identify_bench.h"

enum { P = 20, Q = RIG_NU + P * RIG_M, N = 3000, ENOUGH = 10 * Q + P, SOURCES = 3 };

static const uint32_t of_the_observer =
    OKID_NOTE_ARX_STABILISED | OKID_NOTE_ILL_CONDITIONED | OKID_NOTE_FEW_ROWS | OKID_NOTE_WEAK_EXCITATION;

/// By the Gram matrix, by the sums of one run, by the factor.
static void identify(const double* v, int count, int source) {
    const okid_identify_config_t config = {.n_u = RIG_NU,
                                           .n_y = RIG_NY,
                                           .p = P,
                                           .order = RIG_NZ,
                                           .fs_hz = RIG_FS,
                                           .detrend = OKID_DETREND_MEAN,
                                           .solver = source == 1 ? OKID_SOLVER_STRUCTURED : OKID_SOLVER_DENSE};
    create(&config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, (size_t)count));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(square_root, v, (size_t)count));
    TEST_ASSERT_GREATER_OR_EQUAL(0, source == 2 ? okid_identify_run_factor(identifier, square_root, &model)
                                                : okid_identify_run(identifier, accumulator, &model));
}

static void note(uint32_t bit, int expected) {
    TEST_ASSERT_EQUAL_MESSAGE(expected, (model.warnings & bit) != 0, okid_warning_code(bit));
}

static void an_ordinary_record_has_none(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 5);
    for (int source = 0; source < SOURCES; ++source) {
        identify(v, N, source);
        TEST_ASSERT_EQUAL(0, model.warnings & of_the_observer);
        TEST_ASSERT_TRUE(model.observer_info.radius_plain < 1);
        TEST_ASSERT_EQUAL_DOUBLE(model.observer_info.radius_plain, model.observer_info.radius);
    }
    free(v);
}

// Trap 22: plain least squares are unstable here, and not by much.
static void a_radius_of_one_and_more_is_stabilised(void) {
    double *v = rig_record(&rig, N, 0, NULL, 9), *filtered = rig_filtered(v, N);
    for (int source = 0; source < SOURCES; ++source) {
        identify(filtered, N, source);
        TEST_ASSERT_TRUE(model.observer_info.radius_plain >= 1 && model.observer_info.radius_plain < 2);
        TEST_ASSERT_TRUE(model.observer_info.radius < 1);
        note(OKID_NOTE_ARX_STABILISED, 1);
    }
    free(v);
    free(filtered);
}

static void fewer_than_ten_rows_an_unknown_are_few(void) {
    double* v = rig_record(&rig, ENOUGH, 0.05, NULL, 6);
    for (int source = 0; source < SOURCES; ++source) {
        identify(v, ENOUGH, source);
        TEST_ASSERT_EQUAL(10 * Q, model.regression_rows);
        note(OKID_NOTE_FEW_ROWS, 0);
        identify(v, ENOUGH - 1, source);
        note(OKID_NOTE_FEW_ROWS, 1);
    }
    free(v);
}

static void no_noise_is_ill_conditioned(void) {
    double* v = rig_record(&rig, N, 0, NULL, 3);
    for (int source = 0; source < SOURCES; ++source) {
        identify(v, N, source);
        TEST_ASSERT_TRUE(model.observer_info.condition > 1e10);
        note(OKID_NOTE_ILL_CONDITIONED, 1);
    }
    free(v);
}

// Three sines with noise of 1e-9 of their power: six directions are excited, all others hardly.
static void hardly_excited_directions_are_weak(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 7);
    uint64_t state = 3;
    for (int n = 0; n < N; ++n)
        v[n * RIG_M] = sin(0.3 * n) + sin(1.1 * n + 1) + sin(2.0 * n + 2) + 4e-5 * rig_normal(&state);
    for (int source = 0; source < SOURCES; ++source) {
        identify(v, N, source);
        TEST_ASSERT_TRUE(model.observer_info.input_excitation > 1e-10 && model.observer_info.input_excitation < 1e-8);
        note(OKID_NOTE_WEAK_EXCITATION, 1);
    }
    for (int n = 0; n < N; ++n) v[n * RIG_M] += 1e-3 * rig_normal(&state);
    for (int source = 0; source < SOURCES; ++source) {
        identify(v, N, source);
        TEST_ASSERT_TRUE(model.observer_info.input_excitation > 1e-8 && model.observer_info.input_excitation < 1e-5);
        note(OKID_NOTE_WEAK_EXCITATION, 0);
    }
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(an_ordinary_record_has_none);
    RUN_TEST(a_radius_of_one_and_more_is_stabilised);
    RUN_TEST(fewer_than_ten_rows_an_unknown_are_few);
    RUN_TEST(no_noise_is_ill_conditioned);
    RUN_TEST(hardly_excited_directions_are_weak);
    return UNITY_END();
}
