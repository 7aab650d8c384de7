// SPDX-License-Identifier: MIT
// What the three solvers say of the excitation, against the pivots of the input lags by Gram and Schmidt on the rows
// themselves: the largest rest first from the Gram matrix and the factor, lag after lag from the sums of one run.
#include "modal_rig.h"

#include <okid/okid.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { NU = 2, NY = 1, M = NU + NY, P = 4, W = M * (P + 1), LAGGED = NU * (P + 1), N = 400 };

static const okid_observer_config_t config = {NU, NY, P, 0, 0};
static double samples[N * M], column[LAGGED][N];
static okid_real_t theta[NY * W];
static okid_observer_info_t info;

/// Inputs that are correlated in time and with each other, one of them in other units; the output follows with noise.
static void make(double independent) {
    uint64_t state = 5;
    double first = 0, second = 0, y = 0;
    for (int n = 0; n < N; ++n) {
        first = 0.7 * first + rig_normal(&state);
        second = 0.3 * second - 0.4 * first + independent * rig_normal(&state);
        samples[n * M] = first;
        samples[n * M + 1] = 50 * (independent > 0 ? second : first);
        samples[n * M + 2] = y = 0.5 * y + first + 0.1 * rig_normal(&state);
    }
}

/// Smallest over largest squared rest of the input lags, all of unit length at first, or each of the length that its channel
/// has at lag 0.
static double excitation(int largest_first) {
    double most = 0, least = 1;
    for (int k = 0; k < LAGGED; ++k) {
        double square = 0;
        for (int n = P; n < N; ++n) {
            const int lag = largest_first ? k / NU : 0;
            square += pow(samples[(n - lag) * M + k % NU], 2);
        }
        for (int n = P; n < N; ++n) column[k][n] = samples[(n - k / NU) * M + k % NU] / sqrt(square);
    }
    for (int k = 0; k < LAGGED; ++k) {
        int best = k;
        double rest = 0;
        for (int i = k; i < (largest_first ? LAGGED : k + 1); ++i) {
            double square = 0;
            for (int n = P; n < N; ++n) square += column[i][n] * column[i][n];
            if (square > rest) rest = square, best = i;
        }
        for (int n = P; n < N; ++n) {
            const double x = column[best][n];
            column[best][n] = column[k][n];
            column[k][n] = x;
        }
        most = fmax(most, rest);
        least = fmin(least, rest);
        for (int i = k + 1; i < LAGGED; ++i) {
            double along = 0;
            for (int n = P; n < N; ++n) along += column[k][n] * column[i][n] / rest;
            for (int n = P; n < N; ++n) column[i][n] -= along * column[k][n];
        }
    }
    return least / most;
}

static okid_status_t by_gram(void) {
    const okid_accumulator_config_t a = {.n_u = NU, .n_y = NY, .lags = P, .forgetting = 1};
    const size_t bytes = okid_accumulator_memsize(&a), more = okid_observer_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static double gram[W * W];
    okid_accumulator_t* sums = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(sums, OKID_DETREND_NONE, gram, NULL));
    const okid_status_t status = okid_observer_solve(&config, gram, N - P, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

static okid_status_t by_factor(void) {
    const okid_square_root_config_t a = {.n_u = NU, .n_y = NY, .lags = P, .forgetting = 1};
    const size_t bytes = okid_square_root_memsize(&a), more = okid_observer_factor_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static okid_real_t factor[W * W];
    okid_square_root_t* rows = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&rows, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(rows, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(rows, OKID_DETREND_NONE, factor, NULL));
    const okid_status_t status = okid_observer_solve_factor(&config, factor, N - P, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

static okid_status_t by_sums(void) {
    const okid_accumulator_config_t a = {.n_u = NU, .n_y = NY, .lags = P, .forgetting = 1, .edges = 1};
    const size_t bytes = okid_accumulator_memsize(&a), more = okid_structured_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static double S[M * W], head[M * P], tail[M * P], sum[M], mean[M];
    okid_run_sums_t run = {S, head, tail, sum, mean, 0};
    okid_accumulator_t* sums = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_run(sums, OKID_DETREND_NONE, &run));
    const okid_status_t status = okid_structured_solve(&config, OKID_DETREND_NONE, &run, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

void setUp(void) { info = (okid_observer_info_t){.channel = -2}; }
void tearDown(void) {}

static void it_is_the_ratio_of_the_pivots(void) {
    static const double independent[] = {1.0, 0.1, 1e-2};
    for (int k = 0; k < 3; ++k) {
        make(independent[k]);
        const double pivoted = excitation(1), in_order = excitation(0);
        TEST_ASSERT_TRUE(pivoted > 1e-6 && pivoted < 0.9);
        TEST_ASSERT_EQUAL(OKID_OK, by_gram());
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * pivoted, pivoted, info.input_excitation);
        TEST_ASSERT_EQUAL(OKID_OK, by_factor());
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * pivoted, pivoted, info.input_excitation);
        TEST_ASSERT_EQUAL(OKID_OK, by_sums());
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * in_order, in_order, info.input_excitation);
        TEST_ASSERT_EQUAL(-1, info.channel);
    }
}

static void an_input_that_repeats_another_is_named_and_excites_nothing(void) {
    okid_status_t (*const solvers[])(void) = {by_gram, by_factor, by_sums};
    make(0);
    for (int k = 0; k < 3; ++k) {
        TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, solvers[k]());
        TEST_ASSERT_EQUAL(1, info.channel);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 0, info.input_excitation);
    }
}

// So many sines as leave one direction too few: five of each input are wanted, two sines have four.
static void two_sines_are_too_few_and_three_are_enough(void) {
    okid_status_t (*const solvers[])(void) = {by_gram, by_factor, by_sums};
    for (int sines = 2; sines <= 3; ++sines) {
        make(1);
        for (int n = 0; n < N; ++n)
            for (int j = 0; j < NU; ++j) {
                samples[n * M + j] = 0;
                for (int s = 0; s < sines; ++s) samples[n * M + j] += sin((0.4 + 0.3 * j + 0.8 * s) * n + s + j);
            }
        for (int k = 0; k < 3; ++k) TEST_ASSERT_EQUAL(sines == 2 ? OKID_ERR_EXCITATION : OKID_OK, solvers[k]());
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(it_is_the_ratio_of_the_pivots);
    RUN_TEST(an_input_that_repeats_another_is_named_and_excites_nothing);
    RUN_TEST(two_sines_are_too_few_and_three_are_enough);
    return UNITY_END();
}
