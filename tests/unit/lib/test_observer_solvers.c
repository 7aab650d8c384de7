// SPDX-License-Identifier: MIT
// The three solvers of the observer against the rows themselves. Excitation: pivots of the input lags by Gram and
// Schmidt, the largest rest first from the Gram matrix and the factor, lag after lag from the sums of one run. Ridge:
// normal equations.
#include "modal_rig.h"

#include <okid/okid.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { NU = 2, NY = 1, M = NU + NY, P = 8, W = M * (P + 1), LAGGED = NU * (P + 1), N = 400 };

static okid_observer_config_t config = {NU, NY, P, 0, 0};
static double across; // what the sums are to say of the two inputs, where it is not 0
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

/// Smallest over largest squared rest of the input lags. first < 0: lag after lag, each of the length that its channel
/// has at lag 0 in units of it. Else all of unit length, this one first, then the one with the largest rest.
static double excitation(int first) {
    double most = 0, least = 1;
    for (int k = 0; k < LAGGED; ++k) {
        double square = 0;
        for (int n = P; n < N; ++n) square += pow(samples[(n - (first < 0 ? 0 : k / NU)) * M + k % NU], 2);
        for (int n = P; n < N; ++n) column[k][n] = samples[(n - k / NU) * M + k % NU] / sqrt(square);
    }
    for (int k = 0; k < LAGGED; ++k) {
        int best = k;
        double rest = 0;
        for (int i = k; i < (first < 0 ? k + 1 : LAGGED); ++i) {
            double square = 0;
            for (int n = P; n < N; ++n) square += column[i][n] * column[i][n];
            if (square > rest) rest = square, best = i;
        }
        if (k == 0 && first >= 0) best = first;
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

/// Columns of unit length are as large as each other: which one comes first is left to rounding.
static void is_a_ratio_of_pivots(double found) {
    double nearest = HUGE_VAL;
    for (int first = 0; first < LAGGED; ++first) nearest = fmin(nearest, fabs(excitation(first) / found - 1));
    TEST_ASSERT_TRUE(nearest < 1e-6);
}

static okid_status_t by_gram(void) {
    const okid_accumulator_config_t a = {.n_u = NU, .n_y = NY, .lags = config.p, .forgetting = 1};
    const size_t bytes = okid_accumulator_memsize(&a), more = okid_observer_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static double gram[W * W];
    okid_accumulator_t* sums = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(sums, OKID_DETREND_NONE, gram, NULL));
    const okid_status_t status = okid_observer_solve(&config, gram, N - config.p, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

static okid_status_t by_factor(void) {
    const okid_square_root_config_t a = {.n_u = NU, .n_y = NY, .lags = config.p, .forgetting = 1};
    const size_t bytes = okid_square_root_memsize(&a), more = okid_observer_factor_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static okid_real_t factor[W * W];
    okid_square_root_t* rows = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&rows, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(rows, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(rows, OKID_DETREND_NONE, factor, NULL));
    const okid_status_t status =
        okid_observer_solve_factor(&config, factor, N - config.p, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

static okid_status_t by_sums(void) {
    const okid_accumulator_config_t a = {.n_u = NU, .n_y = NY, .lags = config.p, .forgetting = 1, .edges = 1};
    const size_t bytes = okid_accumulator_memsize(&a), more = okid_structured_memsize(&config);
    void *block = malloc(bytes), *work = malloc(more);
    static double S[M * W], head[M * P], tail[M * P], sum[M], mean[M];
    okid_run_sums_t run = {S, head, tail, sum, mean, 0};
    okid_accumulator_t* sums = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_run(sums, OKID_DETREND_NONE, &run));
    if (across != 0) S[1] = S[M] = across * sqrt(S[0] * S[M + 1]);
    const okid_status_t status =
        okid_structured_solve(&config, OKID_DETREND_NONE, &run, theta, NULL, &info, work, more);
    free(block);
    free(work);
    return status;
}

void setUp(void) {
    info = (okid_observer_info_t){.channel = -2};
    config.p = P;
    config.ridge_min = 0;
    across = 0;
}
void tearDown(void) {}

static void it_is_the_ratio_of_the_pivots(void) {
    static const double independent[] = {1.0, 0.1, 1e-2};
    for (int k = 0; k < 3; ++k) {
        make(independent[k]);
        TEST_ASSERT_EQUAL(OKID_OK, by_gram());
        is_a_ratio_of_pivots(info.input_excitation);
        TEST_ASSERT_EQUAL(OKID_OK, by_factor());
        is_a_ratio_of_pivots(info.input_excitation);
        TEST_ASSERT_EQUAL(OKID_OK, by_sums());
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, info.input_excitation / excitation(-1));
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

// Sums that no record has stop the elimination before the first pivot.
static void impossible_sums_excite_nothing(void) {
    make(1);
    across = 1.5;
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, by_sums());
    TEST_ASSERT_EQUAL(0, info.channel);
    TEST_ASSERT_EQUAL_DOUBLE(0, info.input_excitation);
}

/// Inputs of so many sines each; `alternates`: and the first one of -1, 1, -1 .. too.
static void sines(int of_first, int of_second, int alternates) {
    make(1);
    for (int n = 0; n < N; ++n)
        for (int j = 0; j < NU; ++j) {
            samples[n * M + j] = j == 0 && alternates ? 1 - 2 * (n % 2) : 0;
            for (int s = 0; s < (j == 0 ? of_first : of_second); ++s)
                samples[n * M + j] += sin((0.4 + 0.3 * j + 0.8 * s) * n + s + j);
        }
}

// A sine is two directions, what alternates one. More than four of each input are wanted, more than p of a short
// observer.
static void as_many_directions_are_wanted_as_leave_none_to_chance(void) {
    okid_status_t (*const solvers[])(void) = {by_gram, by_factor, by_sums};
    static const struct {
        int p, of_first, of_second, alternates;
        okid_status_t expected;
    } cases[] = {{P, 2, 2, 0, OKID_ERR_EXCITATION}, {P, 2, 2, 1, OKID_OK},
                 {P, 1, 3, 0, OKID_ERR_EXCITATION}, {P, 3, 3, 0, OKID_OK},
                 {4, 2, 2, 0, OKID_ERR_EXCITATION}, {4, 2, 2, 1, OKID_OK},
                 {2, 1, 1, 0, OKID_ERR_EXCITATION}, {2, 1, 1, 1, OKID_OK}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        sines(cases[i].of_first, cases[i].of_second, cases[i].alternates);
        config.p = cases[i].p;
        for (int k = 0; k < 3; ++k) TEST_ASSERT_EQUAL(cases[i].expected, solvers[k]());
    }
}

/// Sum over the rows of regressor k times regressor l, k = REGRESSORS: the output.
static double product(int k, int l) {
    const int place[2] = {k < NU                   ? k
                          : k == NU + config.p * M ? NU
                                                   : k + NY,
                          l < NU                   ? l
                          : l == NU + config.p * M ? NU
                                                   : l + NY};
    double sum = 0;
    for (int n = config.p; n < N; ++n)
        sum += samples[(n - place[0] / M) * M + place[0] % M] * samples[(n - place[1] / M) * M + place[1] % M];
    return sum;
}

// (G + ridge D) theta = g: D is the diagonal of G, from the sums of one run that of each channel at lag 0.
static void a_ridge_that_is_asked_for_is_used(void) {
    okid_status_t (*const solvers[])(void) = {by_gram, by_factor, by_sums};
    static const double ridges[] = {1e-6, 1e-3, 0.5};
    make(1);
    config.p = 3;
    const int q = NU + config.p * M;
    for (int r = 0; r < 3; ++r)
        for (int solver = 0; solver < 3; ++solver) {
            config.ridge_min = ridges[r];
            TEST_ASSERT_EQUAL(OKID_OK, solvers[solver]());
            TEST_ASSERT_EQUAL_DOUBLE(ridges[r], info.ridge);
            for (int k = 0; k < q; ++k) {
                const double size = product(k, k), wanted = product(k, q);
                const int channel = k < NU ? k : (k + NY) % M;
                double power = size, left = -wanted;
                if (solver == 2) power = product(channel < NU ? channel : q, channel < NU ? channel : q);
                for (int l = 0; l < q; ++l) left += product(k, l) * (double)theta[l];
                left += ridges[r] * power * (double)theta[k];
                TEST_ASSERT_DOUBLE_WITHIN(1e-8 * sqrt(size * product(q, q)), 0, left);
            }
        }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(it_is_the_ratio_of_the_pivots);
    RUN_TEST(an_input_that_repeats_another_is_named_and_excites_nothing);
    RUN_TEST(a_ridge_that_is_asked_for_is_used);
    RUN_TEST(impossible_sums_excite_nothing);
    RUN_TEST(as_many_directions_are_wanted_as_leave_none_to_chance);
    return UNITY_END();
}
