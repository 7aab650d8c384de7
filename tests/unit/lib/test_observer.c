// SPDX-License-Identifier: MIT
// OKID least squares and the Markov recursion; the traps of the printed equations that live here.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <okid/steps/observer.h>
#include <unity.h>

enum { P = 10, Q = RIG_NU + P * RIG_M, W = RIG_M * (P + 1), LAST = 60 };

// Of the Markov parameters, relative to the largest. float: theta rounded once (6e-8) and the recursion over it, 4 times
// the worst measured on both backends.
static const double noise_free_limit = TOLERANCE(1e-7, 1e-6), moving_limit = TOLERANCE(1e-6, 1.3e-6);

static rig_t rig;
static double gram[W * W];
static okid_real_t theta[RIG_NY * Q], innovation[RIG_NY * RIG_NY];
static okid_real_t markov[(LAST + 1) * RIG_NY], gain[LAST * RIG_NY * RIG_NY];
static okid_observer_info_t info;

void setUp(void) { rig_make(&rig); }
void tearDown(void) {}

static void gram_of(const double* v, int count, okid_detrend_t detrend) {
    const okid_accumulator_config_t config = {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 0, 0};
    const size_t bytes = okid_accumulator_memsize(&config);
    void* block = malloc(bytes);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, v, (size_t)count));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, detrend, gram, NULL));
    free(block);
}

static okid_status_t solve(const okid_observer_config_t* config, long rows) {
    const size_t bytes = okid_observer_memsize(config);
    void* work = malloc(bytes);
    const okid_status_t status = okid_observer_solve(config, gram, rows, theta, innovation, &info, work, bytes);
    free(work);
    return status;
}

static const okid_observer_config_t plain = {RIG_NU, RIG_NY, P, 0, 0};

static double markov_error(void) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(RIG_NU, RIG_NY, P, theta, LAST, markov, gain));
    double worst = 0, size = 0;
    for (int k = 0; k <= LAST; ++k) {
        double expected[RIG_NY];
        rig_markov(&rig, k, expected);
        for (int o = 0; o < RIG_NY; ++o) {
            worst = fmax(worst, fabs(expected[o] - markov[k * RIG_NY + o]));
            size = fmax(size, fabs(expected[o]));
        }
    }
    return worst / size;
}

// Trap 5: without noise the Gram matrix has rank n_u + p n_u + n_z = 17 of 41; back-substitution would give garbage.
static void trap_05_noise_free_rank_deficiency(void) {
    double* v = rig_record(&rig, 2000, 0, NULL, 3);
    gram_of(v, 2000, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, 2000 - P));
    TEST_ASSERT_TRUE(info.condition > 1e11);
    TEST_ASSERT_TRUE(markov_error() < noise_free_limit);
    free(v);
}

// Trap 4: a structure that already moves. Zeros for the unknown past would bias the estimate; rows without them do not.
static void trap_04_moving_start_needs_no_zero_columns(void) {
    double x0[RIG_NZ];
    for (int i = 0; i < RIG_NZ; ++i) x0[i] = 30;
    double* v = rig_record(&rig, 2000, 0, x0, 3);
    gram_of(v, 2000, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, 2000 - P));
    TEST_ASSERT_TRUE(markov_error() < moving_limit);
    double* padded = calloc((2000 + P) * RIG_M, sizeof *padded); // eq. (38) as printed
    memcpy(padded + P * RIG_M, v, sizeof *v * 2000 * RIG_M);
    gram_of(padded, 2000 + P, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, 2000));
    TEST_ASSERT_TRUE(markov_error() > 1e-4);
    free(v);
    free(padded);
}

// Trap 2: the least-squares estimate is [Ybar^I, -Ybar^II]; without the minus sign the Markov parameters are nonsense.
static void trap_02_minus_sign_of_eq_26(void) {
    double* v = rig_record(&rig, 4000, 0.01, NULL, 5);
    gram_of(v, 4000, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, 4000 - P));
    TEST_ASSERT_TRUE(markov_error() < 0.02);
    for (int h = 0; h < P; ++h)
        for (int i = 0; i < RIG_NY * RIG_NY; ++i) theta[(RIG_NU + h * RIG_M + RIG_NU) * RIG_NY + i] *= -1;
    TEST_ASSERT_TRUE(markov_error() > 0.5);
    free(v);
}

static void innovation_is_the_noise(void) {
    double* v = rig_record(&rig, 20000, 0.05, NULL, 8);
    gram_of(v, 20000, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, 20000 - P));
    for (int o = 0; o < RIG_NY; ++o) { // never below the measurement noise, not far above it
        TEST_ASSERT_TRUE(innovation[o * RIG_NY + o] > 0.95 * 0.15 * 0.15);
        TEST_ASSERT_TRUE(innovation[o * RIG_NY + o] < 2.5 * 0.15 * 0.15);
    }
    TEST_ASSERT_TRUE(info.radius < 1 && info.radius == info.radius_plain);
    free(v);
}

// Trap 22: outputs behind a steep anti-alias filter that the force does not see make the plain estimate unstable; the
// smallest ridge of the grid that cures it is found.
static void trap_22_unstable_arx_is_stabilised(void) {
    enum { N = 3000 };
    double *v = rig_record(&rig, N, 0, NULL, 9), *filtered = rig_filtered(v, N);
    gram_of(filtered, N, OKID_DETREND_MEAN);
    okid_observer_config_t leave = plain;
    leave.unstable = 1;
    TEST_ASSERT_EQUAL(OKID_OK, solve(&leave, N - P));
    const double before = info.radius;
    TEST_ASSERT_TRUE(before > 1.1);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, N - P));
    TEST_ASSERT_EQUAL_DOUBLE(before, info.radius_plain);
    TEST_ASSERT_TRUE(info.radius < 1);
    TEST_ASSERT_TRUE(info.ridge > 1e-12);
    free(v);
    free(filtered);
}

static void constant_and_dead_channels_are_named(void) {
    double* v = rig_record(&rig, 500, 0.01, NULL, 2);
    for (int n = 0; n < 500; ++n) v[n * RIG_M + 2] = 0;
    gram_of(v, 500, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_ERR_OUTPUT, solve(&plain, 500 - P));
    TEST_ASSERT_EQUAL(2, info.channel);
    for (int n = 0; n < 500; ++n) v[n * RIG_M] = 0;
    gram_of(v, 500, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_ERR_INPUT, solve(&plain, 500 - P));
    TEST_ASSERT_EQUAL(0, info.channel);
    free(v);
}

/// The recursion written out: Y_n = own_n + sum over h of theta^y_h Y_(n-h); that of the gain begins at n = 1, with the sign
/// of its own term turned over and no feedback of the instant itself.
static void both_recursions_are_what_they_say(void) {
    enum { U = 2, O = 3, LAGS = 3, M = U + O, COUNT = 8 };
    okid_real_t given[O * (U + LAGS * M)], system[(COUNT + 1) * O * U], gains[COUNT * O * O],
        alone[(COUNT + 1) * O * U];
    for (int i = 0; i < O * (U + LAGS * M); ++i) given[i] = (okid_real_t)(sin(3.0 * i) / 4);
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(U, O, LAGS, given, COUNT, system, gains));
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(U, O, LAGS, given, COUNT, alone, NULL));
    TEST_ASSERT_EQUAL_MEMORY(alone, system, sizeof alone);
    for (int kind = 0; kind < 2; ++kind) { // Y, then the gain
        const okid_real_t* found = kind ? gains : system;
        const int width = kind ? O : U;
        for (int n = kind; n <= COUNT; ++n)
            for (int c = 0; c < width; ++c)
                for (int o = 0; o < O; ++o) {
                    double expected = n == 0 ? (double)given[c * O + o] : 0;
                    const int own = U + (n - 1) * M + (kind ? U : 0);
                    if (n > 0 && n <= LAGS) expected = (kind ? -1 : 1) * (double)given[(own + c) * O + o];
                    for (int h = 1; h <= LAGS && h <= n - kind; ++h)
                        for (int k = 0; k < O; ++k)
                            expected += (double)given[(U + (h - 1) * M + U + k) * O + o] *
                                        (double)found[((n - kind - h) * width + c) * O + k];
                    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-14, 1e-6), expected,
                                              (double)found[((n - kind) * width + c) * O + o]);
                }
    }
}

/// A response that is too young to have been seen so long ago: its oldest lags are zero in every row, those of one output
/// or of all. They take no part, and all others fit as well as they can.
static void lags_that_were_never_seen_take_no_part(void) {
    enum { ROWS = 300 };
    for (int zeros = 1; zeros <= RIG_NY; ++zeros) {
        uint64_t seed = 21;
        memset(gram, 0, sizeof gram);
        for (int n = 0; n < ROWS; ++n) {
            double row[W];
            for (int k = 0; k < W; ++k) row[k] = k < W - zeros ? rig_normal(&seed) : 0;
            for (int o = 0; o < RIG_NY; ++o) row[RIG_NU + o] += row[RIG_M + o] + 2 * row[0];
            for (int j = 0; j < W; ++j)
                for (int i = 0; i < W; ++i) gram[j * W + i] += row[i] * row[j];
        }
        okid_observer_config_t leave = plain;
        leave.unstable = 1;
        TEST_ASSERT_EQUAL(OKID_OK, solve(&leave, ROWS));
        for (int o = 0; o < RIG_NY; ++o)
            for (int i = 0; i < Q; ++i) { // the normal equations
                const int row = i < RIG_NU ? i : i + RIG_NY;
                double left = gram[(RIG_NU + o) * W + row];
                for (int k = 0; k < Q; ++k)
                    left -= (double)theta[k * RIG_NY + o] * gram[(k < RIG_NU ? k : k + RIG_NY) * W + row];
                TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-9, 1e-3), 0, left);
                TEST_ASSERT_TRUE(i < Q - zeros || theta[i * RIG_NY + o] == 0);
            }
    }
}

static void one_sine_does_not_excite(void) {
    double* v = rig_record(&rig, 2000, 0, NULL, 2);
    for (int n = 0; n < 2000; ++n) v[n * RIG_M] = sin(0.3 * n);
    gram_of(v, 2000, OKID_DETREND_NONE);
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, solve(&plain, 2000 - P));
    TEST_ASSERT_TRUE(info.input_excitation < 1e-10);
    free(v);
}

static void wrong_use_is_refused(void) {
    char work[16];
    const okid_observer_config_t bad = {0, 3, P, 0, 0};
    TEST_ASSERT_EQUAL(0, okid_observer_memsize(&bad));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_observer_solve(&bad, gram, 100, theta, NULL, &info, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_observer_solve(&plain, gram, 100, theta, NULL, &info, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_observer_solve(&plain, NULL, 100, theta, NULL, &info, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, solve(&plain, Q - 1));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_markov_recursion(0, 3, P, theta, 4, markov, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_markov_recursion(1, 3, P, NULL, 4, markov, NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(trap_05_noise_free_rank_deficiency);
    RUN_TEST(trap_04_moving_start_needs_no_zero_columns);
    RUN_TEST(trap_02_minus_sign_of_eq_26);
    RUN_TEST(innovation_is_the_noise);
    RUN_TEST(trap_22_unstable_arx_is_stabilised);
    RUN_TEST(constant_and_dead_channels_are_named);
    RUN_TEST(both_recursions_are_what_they_say);
    RUN_TEST(lags_that_were_never_seen_take_no_part);
    RUN_TEST(one_sine_does_not_excite);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
