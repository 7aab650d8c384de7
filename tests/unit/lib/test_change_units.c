// SPDX-License-Identifier: MIT
// Units of the channels mean nothing to a change test: baseline, shifts and what is said of them stay, with several
// forces and sensors, blocks of unequal loudness, and where no force is measured.
#include "wide_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { ROWS = 5, LAGS = 2 * ROWS - 1, BLOCKS = 10, LENGTH = 400, M = 5, MODES = 16 };

typedef struct found_t {
    int count, order;
    okid_change_mode_t baseline[MODES], tested[MODES];
    okid_change_verdict_t verdict;
} found_t;

static double* records[2]; // of the baseline; of a structure that is stiffer by some percent

void setUp(void) {
    for (int k = 0; k < 2; ++k) {
        wide_t rig;
        wide_make(&rig, 2, 3);
        if (k == 1) {
            const double a = rig.A[0], b = rig.A[1], turn = 0.004;
            rig.A[0] = rig.A[WIDE_NZ + 1] = a * cos(turn) - b * sin(turn);
            rig.A[1] = a * sin(turn) + b * cos(turn);
            rig.A[WIDE_NZ] = -rig.A[1];
        }
        records[k] = wide_record(&rig, BLOCKS * LENGTH, 0.3, 3 + (uint64_t)k);
        for (int n = 0; n < BLOCKS * LENGTH; ++n) // every block has a loudness of its own
            for (int c = 0; c < M; ++c) records[k][n * M + c] *= 1 + 0.5 * (n / LENGTH % 4);
    }
}
void tearDown(void) { free(records[0]), free(records[1]); }

static found_t run(int n_u, const double* unit) {
    const okid_change_config_t c = okid_change_defaults(n_u, 3, ROWS, WIDE_FS);
    const okid_accumulator_config_t a = okid_accumulator_defaults(n_u, 3, LAGS);
    const size_t bytes = okid_change_memsize(&c), more = okid_accumulator_memsize(&a);
    void *block = malloc(bytes), *own = malloc(more);
    double* scratch = malloc(sizeof *scratch * (size_t)(M * M * (LAGS + 1) * (LAGS + 1)));
    okid_change_t* self = NULL;
    okid_accumulator_t* sums = NULL;
    found_t out = {0};
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_create(&self, &c, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, own, more));
    for (int k = 0; k < 2; ++k) {
        for (int n = 0; n < BLOCKS * LENGTH; ++n) {
            double sample[M];
            for (int i = 0; i < n_u + 3; ++i) sample[i] = records[k][n * M + 2 - n_u + i] * unit[2 - n_u + i];
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, sample, 1));
            if ((n + 1) % LENGTH != 0) continue;
            TEST_ASSERT_EQUAL(OKID_OK, okid_change_add(self, sums, scratch));
            okid_accumulator_reset(sums);
        }
        if (k == 0) TEST_ASSERT_EQUAL(OKID_OK, okid_change_learn(self));
        if (k == 1) TEST_ASSERT_EQUAL(OKID_OK, okid_change_test(self, &out.verdict));
        okid_change_mode_t* to = k == 0 ? out.baseline : out.tested;
        for (out.count = 0; okid_change_mode(self, out.count, &to[out.count]) == OKID_OK;) ++out.count;
    }
    out.order = okid_change_order(self);
    free(block);
    free(own);
    free(scratch);
    return out;
}

static void alike(double a, double b) { TEST_ASSERT_DOUBLE_WITHIN(1e-6 * fabs(a) + 1e-12, a, b); }

static void units_mean_nothing(int n_u) {
    static const double plain[M] = {1, 1, 1, 1, 1}, others[M] = {3, 1e3, 1e-2, 50, 0.1};
    const found_t one = run(n_u, plain), other = run(n_u, others);
    TEST_ASSERT_GREATER_THAN(0, one.count);
    TEST_ASSERT_EQUAL(one.count, other.count);
    TEST_ASSERT_EQUAL(one.order, other.order);
    for (int k = 0; k < one.count; ++k) {
        alike(one.baseline[k].frequency_hz, other.baseline[k].frequency_hz);
        alike(one.baseline[k].damping_ratio, other.baseline[k].damping_ratio);
        alike(one.tested[k].shift, other.tested[k].shift);
        alike(one.tested[k].sigma, other.tested[k].sigma);
        TEST_ASSERT_TRUE(one.baseline[k].damping_ratio > 0 && one.baseline[k].damping_ratio <= 0.2);
    }
    alike(one.verdict.statistic, other.verdict.statistic);
    alike(one.verdict.freedom, other.verdict.freedom);
    TEST_ASSERT_EQUAL(one.verdict.farthest, other.verdict.farthest);
    TEST_ASSERT_EQUAL(one.verdict.alarm, other.verdict.alarm);
}

static void with_forces(void) { units_mean_nothing(2); }
static void without_forces(void) { units_mean_nothing(0); }

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(with_forces);
    RUN_TEST(without_forces);
    return UNITY_END();
}
