// SPDX-License-Identifier: MIT
// The automatic order: gap, level of the observer's errors, and what the scan does where neither is clear.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 30, N = 8000 };

static rig_t rig;
static void *block, *sums;
static okid_identified_t model;

void setUp(void) { rig_make(&rig); }
void tearDown(void) {
    free(block);
    free(sums);
    block = sums = NULL;
}

static okid_status_t identify(double noise, const okid_identify_config_t* config, uint64_t seed) {
    double* v = rig_record(&rig, N, noise, NULL, seed);
    const okid_accumulator_config_t a = {
        .n_u = RIG_NU, .n_y = RIG_NY, .lags = okid_identify_lags(config), .forgetting = 1, .edges = 1};
    const size_t bytes = okid_identify_memsize(config), more = okid_accumulator_memsize(&a);
    tearDown();
    block = malloc(bytes);
    sums = malloc(more);
    okid_accumulator_t* accumulator;
    okid_identify_t* identifier;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, sums, more));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    const okid_status_t status = okid_identify_run(identifier, accumulator, &model);
    free(v);
    return status;
}

static okid_identify_config_t automatic(void) {
    const okid_identify_config_t c = {.n_u = RIG_NU, .n_y = RIG_NY, .p = P, .fs_hz = RIG_FS};
    return c;
}

static void values_above_the_noise_are_counted(void) {
    const okid_identify_config_t c = automatic();
    double before = 0;
    for (double noise = 0.01; noise < 1; noise *= 3) {
        for (uint64_t seed = 1; seed <= 3; ++seed) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, identify(noise, &c, seed));
            int above = 0;
            while (above < model.singular_count && (double)model.singular_values[above] > model.noise_level) ++above;
            TEST_ASSERT_EQUAL(RIG_NZ, above);
            TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
            TEST_ASSERT_EQUAL(0, model.warnings & OKID_NOTE_ORDER_UNCLEAR);
        }
        TEST_ASSERT_TRUE(model.noise_level > 2 * before); // about three times: linear in the noise
        before = model.noise_level;
    }
}

// Where the noise is four times the response the gap is no longer clear by itself; as it stands at the noise level it is
// believed all the same.
static void the_noise_level_makes_a_small_gap_clear(void) {
    const okid_identify_config_t c = automatic();
    int small = 0;
    for (uint64_t seed = 1; seed <= 4; ++seed) {
        TEST_ASSERT_GREATER_OR_EQUAL(0, identify(4, &c, seed));
        const double gap = (double)(model.singular_values[RIG_NZ - 1] / model.singular_values[RIG_NZ]);
        TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
        small += gap < 10;
    }
    TEST_ASSERT_GREATER_THAN(0, small);
}

static void it_is_not_known_elsewhere(void) {
    okid_identify_config_t c = automatic();
    c.order = RIG_NZ;
    TEST_ASSERT_EQUAL(OKID_OK, identify(0.01, &c, 1));
    TEST_ASSERT_TRUE(isnan(model.noise_level));
    c = automatic();
    c.solver = OKID_SOLVER_STRUCTURED;
    TEST_ASSERT_EQUAL(OKID_OK, identify(0.01, &c, 1));
    TEST_ASSERT_TRUE(isnan(model.noise_level));
    c = automatic();
    c.method = OKID_METHOD_N4SID_MOESP;
    c.rows = 20;
    TEST_ASSERT_GREATER_OR_EQUAL(0, identify(0.01, &c, 1));
    TEST_ASSERT_TRUE(isnan(model.noise_level));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(values_above_the_noise_are_counted);
    RUN_TEST(the_noise_level_makes_a_small_gap_clear);
    RUN_TEST(it_is_not_known_elsewhere);
    return UNITY_END();
}
