// SPDX-License-Identifier: MIT
// A change of a structure is told from sums of blocks; louder, softer and coloured excitation is none. The truth is a system
// by construction; the shifts of its frequencies are read off its poles. Nothing here is from the library but the sums.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { ROWS = 6, LAGS = 2 * ROWS - 1, BLOCKS = 20, LENGTH = 500 };

static okid_change_t* test;
static okid_accumulator_t* sums;
static void *test_block, *sums_block;
static double* scratch;
static rig_t rig;
static double state[RIG_NZ], force;
static uint64_t seed;

static okid_change_config_t config(void) {
    okid_change_config_t c = okid_change_defaults(RIG_NU, RIG_NY, ROWS, RIG_FS);
    c.false_alarm = 0.01;
    return c;
}

void setUp(void) {
    rig_make(&rig);
    memset(state, 0, sizeof state);
    force = 0;
    seed = 7;
    const okid_change_config_t c = config();
    const okid_accumulator_config_t a = okid_accumulator_defaults(RIG_NU, RIG_NY, LAGS);
    const size_t bytes = okid_change_memsize(&c);
    test_block = malloc(bytes);
    sums_block = malloc(okid_accumulator_memsize(&a));
    scratch = malloc(sizeof *scratch * RIG_M * RIG_M * 4 * ROWS * ROWS);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_change_create(&test, &c, test_block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_create(&test, &c, test_block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, sums_block, okid_accumulator_memsize(&a)));
}

void tearDown(void) {
    free(test_block);
    free(sums_block);
    free(scratch);
}

/// The structure goes on: a force of `level`, each sample `colour` of the one before; an offset on every sensor.
static void run(int count, double level, double colour, double noise) {
    for (int n = 0; n < count; ++n) {
        force = colour * force + level * rig_normal(&seed);
        double sample[RIG_M] = {force}, next[RIG_NZ];
        for (int o = 0; o < RIG_NY; ++o) {
            sample[1 + o] = 2 + rig.D[o] * force + noise * rig_normal(&seed);
            for (int j = 0; j < RIG_NZ; ++j) sample[1 + o] += rig.C[j * RIG_NY + o] * state[j];
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = rig.B[i] * force;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += rig.A[j * RIG_NZ + i] * state[j];
        }
        memcpy(state, next, sizeof state);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, sample, 1));
    }
}

static void feed(int blocks, double level, double colour) {
    for (int b = 0; b < blocks; ++b) {
        okid_accumulator_reset(sums);
        run(LENGTH, level, colour, 0.1);
        TEST_ASSERT_EQUAL(OKID_OK, okid_change_add(test, sums, scratch));
    }
}

static okid_change_verdict_t verdict(void) {
    okid_change_verdict_t out;
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_test(test, &out));
    return out;
}

/// Mode k at `factor` times its frequency.
static void detune(int k, double factor) {
    const double omega = 6.283185307179586 * rig_frequency[k] * factor, zeta = rig_damping[k];
    const double radius = exp(-zeta * omega / RIG_FS), angle = omega * sqrt(1 - zeta * zeta) / RIG_FS;
    const int i = 2 * k;
    rig.A[i * RIG_NZ + i] = rig.A[(i + 1) * RIG_NZ + i + 1] = radius * cos(angle);
    rig.A[i * RIG_NZ + i + 1] = radius * sin(angle);
    rig.A[(i + 1) * RIG_NZ + i] = -radius * sin(angle);
}

static void the_baseline_has_the_modes_of_the_structure(void) {
    feed(BLOCKS, 1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(test));
    TEST_ASSERT_GREATER_OR_EQUAL_INT32(RIG_NZ, okid_change_order(test));
    TEST_ASSERT_EQUAL_INT32(0, okid_change_blocks(test));
    int found = 0;
    okid_change_mode_t mode;
    for (int k = 0; okid_change_mode(test, k, &mode) == OKID_OK; ++k)
        for (int j = 0; j < RIG_MODES; ++j) found += fabs(mode.frequency_hz / rig_frequency[j] - 1) < 0.005;
    TEST_ASSERT_EQUAL_INT(RIG_MODES, found);
}

/// 60 tests of a healthy structure at a rate of 1 %: three alarms or more would come by chance in 2 of 100.
static void other_excitation_is_no_change(void) {
    static const double level[] = {1, 10, 0.5}, colour[] = {0, 0.8, -0.6};
    feed(BLOCKS, 1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(test));
    int alarms = 0;
    for (int k = 0; k < 60; ++k) {
        feed(BLOCKS, level[k % 3], colour[k / 3 % 3]);
        alarms += verdict().alarm;
    }
    TEST_ASSERT_LESS_THAN_INT(3, alarms);
}

static void a_shifted_mode_is_told_and_named(void) {
    feed(BLOCKS, 1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(test));
    for (int k = 0; k < RIG_MODES; ++k) {
        detune(k, 0.99);
        feed(BLOCKS, 3, 0.5);
        detune(k, 1);
        const okid_change_verdict_t found = verdict();
        okid_change_mode_t mode;
        TEST_ASSERT_EQUAL_INT32(1, found.alarm);
        TEST_ASSERT_EQUAL(OKID_OK, okid_change_mode(test, found.farthest, &mode));
        TEST_ASSERT_DOUBLE_WITHIN(0.01 * rig_frequency[k], rig_frequency[k], mode.frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(0.001 + 4 * mode.sigma, -0.01, mode.shift);
    }
}

/// Of two covariances that differ: no fewer than the smaller sample has, no more than both together.
static void both_samples_give_degrees_of_freedom(void) {
    feed(BLOCKS, 1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(test));
    for (int blocks = BLOCKS / 2; blocks <= BLOCKS; blocks += BLOCKS / 4) {
        feed(blocks, 2, 0);
        const okid_change_verdict_t found = verdict();
        TEST_ASSERT_TRUE(found.freedom > blocks - 1 && found.freedom < BLOCKS + blocks - 2);
        TEST_ASSERT_TRUE(found.p_value > 0 && found.p_value <= 1 && found.statistic >= 0);
    }
}

static void one_block_tells_shifts_but_no_probability(void) {
    feed(BLOCKS, 1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(test));
    detune(1, 0.97);
    feed(1, 1, 0);
    const okid_change_verdict_t found = verdict();
    okid_change_mode_t mode;
    TEST_ASSERT_EQUAL_INT32(0, found.alarm);
    TEST_ASSERT_TRUE(isnan(found.p_value));
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_mode(test, found.farthest, &mode));
    TEST_ASSERT_TRUE(isnan(mode.sigma));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, -0.03, mode.shift);
}

static void refusals(void) {
    okid_change_verdict_t out;
    okid_change_mode_t mode;
    okid_change_config_t c = config();
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_change_test(test, &out));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_change_mode(test, 0, &mode));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_change_learn(test));
    okid_accumulator_reset(sums);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_change_add(test, sums, scratch));
    feed(BLOCKS, 0, 0); // noise alone: no modes, or none that are known; never a crash
    run(LENGTH, 1, 0, 0.1);
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_change_add(test, sums, scratch));
    TEST_ASSERT_EQUAL(OKID_ERR_INPUT, okid_change_learn(test));
    TEST_ASSERT_EQUAL_INT32(0, okid_change_order(test));
    c.rows = 7;
    void* block = malloc(okid_change_memsize(&c));
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_create(&test, &c, block, okid_change_memsize(&c)));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_change_add(test, sums, scratch));
    free(block);
    for (int bad = 0; bad < 5; ++bad) {
        c = config();
        if (bad == 0) c.n_y = 0;
        if (bad == 1) c.rows = 1;
        if (bad == 2) c.order = 3;
        if (bad == 3) c.false_alarm = 1;
        if (bad == 4) c.fs_hz = 0;
        TEST_ASSERT_EQUAL_UINT64(0, okid_change_memsize(&c));
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_baseline_has_the_modes_of_the_structure);
    RUN_TEST(other_excitation_is_no_change);
    RUN_TEST(a_shifted_mode_is_told_and_named);
    RUN_TEST(both_samples_give_degrees_of_freedom);
    RUN_TEST(one_block_tells_shifts_but_no_probability);
    RUN_TEST(refusals);
    return UNITY_END();
}
