// SPDX-License-Identifier: MIT
// ERA and ERA/DC on exact Markov parameters of several inputs and outputs: the system comes back with its gain, from
// Hankel matrices of any shape; sizes that make none are refused.
#include "tolerance.h"
#include "wide_rig.h"

#include <okid/okid.h>
#include <okid/steps/era.h>
#include <unity.h>

enum { MOST = 60 };
static const double exact = TOLERANCE(1e-9, 2e-3);

static wide_t rig;
static okid_real_t markov[MOST * WIDE_MOST * WIDE_MOST], gain[MOST * WIDE_MOST * WIDE_MOST];
static okid_real_t A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * WIDE_MOST], C[WIDE_MOST * WIDE_NZ], K[WIDE_NZ * WIDE_MOST];
static double truth[MOST * WIDE_MOST * WIDE_MOST], gains[MOST * WIDE_MOST * WIDE_MOST],
    found[MOST * WIDE_MOST * WIDE_MOST];
static void* block;
static okid_era_t* era;

void setUp(void) {}
void tearDown(void) {
    free(block);
    block = NULL;
}

/// Shapes of H(0), with more rows than columns and the other way; ERA, and ERA/DC with unequal numbers of correlations.
static const okid_era_config_t shapes[] = {{2, 3, 8, 5, 0, 0, 0},  {2, 3, 4, 11, 0, 0, 0}, {3, 2, 6, 9, 0, 0, 0},
                                           {3, 2, 12, 4, 0, 0, 0}, {1, 4, 3, 12, 0, 0, 0}, {2, 3, 8, 6, 2, 1, 2},
                                           {2, 3, 6, 9, 1, 3, 1},  {3, 2, 7, 8, 0, 2, 3},  {3, 2, 9, 4, 3, 0, 4},
                                           {4, 1, 12, 3, 1, 1, 1}, {4, 1, 10, 9, 1, 0, 2}, {4, 1, 10, 9, 0, 1, 1}};
enum { SHAPES = sizeof shapes / sizeof *shapes };

static void create(const okid_era_config_t* c) {
    const size_t bytes = okid_era_memsize(c);
    tearDown();
    TEST_ASSERT_GREATER_THAN(0, bytes);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_era_create(&era, c, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_create(&era, c, block, bytes));
}

/// Y_k, and Y0_k = C A^(k-1) L of a gain K = -L, from Y0_1 on.
static void make(const okid_era_config_t* c) {
    const int last = okid_era_markov_last(c);
    wide_make(&rig, c->n_u, c->n_y);
    wide_truth(&rig, last, truth);
    for (int k = 0; k < (last + 1) * c->n_y * c->n_u; ++k) markov[k] = (okid_real_t)truth[k];
    wide_t other = rig;
    uint64_t state = 3;
    other.n_u = c->n_y;
    for (int k = 0; k < WIDE_NZ * c->n_y; ++k) other.B[k] = -rig_uniform(&state);
    wide_truth(&other, last, gains);
    memmove(gains, gains + c->n_y * c->n_y, sizeof *gains * (size_t)(last * c->n_y * c->n_y));
    for (int k = 0; k < last * c->n_y * c->n_y; ++k) gain[k] = (okid_real_t)gains[k];
}

/// C A^(k-1) X against blocks 1.. of what is expected, n_y x columns each.
static void is_equal(const okid_real_t* X, int columns, double sign, const double* expected, int blocks) {
    static const okid_real_t none[WIDE_MOST * WIDE_MOST] = {0};
    wide_markov(columns, rig.n_y, WIDE_NZ, A, X, C, none, blocks, found);
    for (int k = 0; k < blocks * rig.n_y * columns; ++k)
        TEST_ASSERT_DOUBLE_WITHIN(exact, expected[k], sign * found[rig.n_y * columns + k]);
}

static void exact_parameters_give_the_system_and_its_gain(void) {
    for (int s = 0; s < SHAPES; ++s) {
        const okid_era_config_t* c = &shapes[s];
        create(c);
        make(c);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, WIDE_NZ, A, B, C, gain, K));
        is_equal(B, c->n_u, 1, truth + c->n_y * c->n_u, 12);
        is_equal(K, c->n_y, -1, gains, 12);
        int32_t count = 0;
        const okid_real_t* values = okid_era_singular_values(era, &count);
        TEST_ASSERT_GREATER_THAN(WIDE_NZ, count);
        TEST_ASSERT_TRUE(values[WIDE_NZ] < 1e-5 * values[0] && values[WIDE_NZ - 1] > 1e-5 * values[0]);
    }
}

// What is decomposed once serves every order.
static void another_order_between_changes_nothing(void) {
    for (int s = 0; s < SHAPES; ++s) {
        okid_real_t before[WIDE_NZ * WIDE_NZ], before_K[WIDE_NZ * WIDE_MOST];
        create(&shapes[s]);
        make(&shapes[s]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, WIDE_NZ, A, B, C, gain, K));
        memcpy(before, A, sizeof A);
        memcpy(before_K, K, sizeof K);
        for (int order = 1; order < WIDE_NZ; ++order)
            TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, order, A, B, C, gain, K));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, WIDE_NZ, A, B, C, gain, K));
        TEST_ASSERT_EQUAL_MEMORY(before, A, sizeof A);
        TEST_ASSERT_EQUAL_MEMORY(before_K, K, sizeof(okid_real_t) * (size_t)(WIDE_NZ * shapes[s].n_y));
    }
}

static void modes_of_exact_parameters_are_consistent(void) {
    for (int s = 0; s < SHAPES; ++s) {
        okid_real_t f[WIDE_NZ], zeta[WIDE_NZ], emac[WIDE_NZ], mu_re[WIDE_NZ], mu_im[WIDE_NZ];
        okid_real_t psi_re[WIDE_NZ * WIDE_NZ], psi_im[WIDE_NZ * WIDE_NZ];
        create(&shapes[s]);
        make(&shapes[s]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, WIDE_NZ, A, B, C, NULL, NULL));
        const okid_model_t model = {.n_u = rig.n_u, .n_y = rig.n_y, .n_z = WIDE_NZ, .A = A, .C = C};
        okid_modes_t modes = {.frequency_hz = f,
                              .damping_ratio = zeta,
                              .mu_re = mu_re,
                              .mu_im = mu_im,
                              .psi_re = psi_re,
                              .psi_im = psi_im};
        const size_t bytes = okid_modal_memsize(rig.n_y, WIDE_NZ);
        void* work = malloc(bytes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, 1 / WIDE_FS, &modes, work, bytes));
        free(work);
        TEST_ASSERT_EQUAL(WIDE_MODES, modes.count);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_emac(era, WIDE_NZ, &modes, emac));
        for (int k = 0; k < WIDE_MODES; ++k) {
            TEST_ASSERT_DOUBLE_WITHIN(exact, 1, (double)emac[k]);
            TEST_ASSERT_DOUBLE_WITHIN(exact, 1, (double)f[k] / wide_frequency[k]);
            TEST_ASSERT_DOUBLE_WITHIN(exact, wide_damping[k], (double)zeta[k]);
        }
    }
}

static void the_parameters_decomposed_are_near_themselves(void) {
    for (int s = 0; s < SHAPES; ++s) {
        okid_real_t near_A[WIDE_NZ * WIDE_NZ], near_C[WIDE_MOST * WIDE_NZ];
        if (shapes[s].tau > 0) continue;
        create(&shapes[s]);
        make(&shapes[s]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, WIDE_NZ, A, B, C, NULL, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize_near(era, WIDE_NZ, markov, near_A, near_C));
        for (int k = 0; k < WIDE_NZ * WIDE_NZ; ++k) TEST_ASSERT_DOUBLE_WITHIN(exact, (double)A[k], (double)near_A[k]);
        for (int k = 0; k < rig.n_y * WIDE_NZ; ++k) TEST_ASSERT_DOUBLE_WITHIN(exact, (double)C[k], (double)near_C[k]);
    }
}

static void sizes_say_what_can_be_asked_for(void) {
    for (int s = 0; s < SHAPES; ++s) {
        const okid_era_config_t* c = &shapes[s];
        const int tall = c->rows * c->n_y, columns = (c->cols + c->zeta * c->tau) * c->n_u;
        TEST_ASSERT_EQUAL(c->rows + c->cols + (c->xi + c->zeta) * c->tau, okid_era_markov_last(c));
        if (c->tau == 0) TEST_ASSERT_EQUAL(tall < columns ? tall : columns, okid_era_max_order(c));
        TEST_ASSERT_TRUE(okid_era_max_order(c) <= tall && okid_era_max_order(c) >= WIDE_NZ);
    }
}

static void sizes_that_make_no_matrix_are_refused(void) {
    static const okid_era_config_t good[] = {{1, 1, 1, 1, 0, 0, 0}, {1, 1, 5, 3, 64, 64, 3}, {1, 1, 3, 5, 0, 0, 3}},
                                   bad[] = {{0, 1, 1, 1, 0, 0, 0},  {1, 0, 1, 1, 0, 0, 0},  {1, 1, 0, 1, 0, 0, 0},
                                            {1, 1, 1, 0, 0, 0, 0},  {1, 1, 5, 5, 1, 0, 0},  {1, 1, 5, 5, 0, 1, 0},
                                            {1, 1, 5, 3, 0, 0, 4},  {1, 1, 3, 5, 0, 0, 4},  {1, 1, 5, 5, 65, 0, 1},
                                            {1, 1, 5, 5, 0, 65, 1}, {1, 1, 5, 5, -1, 0, 1}, {1, 1, 5, 5, 0, -1, 1},
                                            {1, 1, 5, 5, 0, 0, -1}};
    for (size_t k = 0; k < sizeof good / sizeof *good; ++k) {
        TEST_ASSERT_GREATER_THAN(0, okid_era_memsize(&good[k]));
        TEST_ASSERT_GREATER_THAN(0, okid_era_max_order(&good[k]));
    }
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) {
        TEST_ASSERT_EQUAL(0, okid_era_memsize(&bad[k]));
        TEST_ASSERT_EQUAL(0, okid_era_max_order(&bad[k]));
        TEST_ASSERT_EQUAL(0, okid_era_markov_last(&bad[k]));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_create(&era, &bad[k], markov, sizeof markov));
    }
}

static void orders_that_are_not_there_are_refused(void) {
    const okid_era_config_t* c = &shapes[0];
    create(c);
    make(c);
    const int most = okid_era_max_order(c);
    okid_real_t *a = malloc(sizeof *a * (size_t)(most * most)), *b = malloc(sizeof *b * (size_t)(most * c->n_u)),
                *d = malloc(sizeof *d * (size_t)(c->n_y * most));
    for (int k = 0; k <= okid_era_markov_last(c); ++k) // full rank
        for (int i = 0; i < c->n_y * c->n_u; ++i)
            markov[k * c->n_y * c->n_u + i] += (okid_real_t)(0.1 * sin(7.0 * k * k + i));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, 1, a, b, d, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, most, a, b, d, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize_near(era, most, markov, a, d));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize(era, 0, a, b, d, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize(era, most + 1, a, b, d, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize_near(era, 0, markov, a, d));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize_near(era, most + 1, markov, a, d));
    for (int k = 0; k < MOST * WIDE_MOST * WIDE_MOST; ++k) markov[k] = 0; // no singular value above 0
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize(era, 1, a, b, d, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize_near(era, 1, markov, a, d));
    free(a);
    free(b);
    free(d);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(exact_parameters_give_the_system_and_its_gain);
    RUN_TEST(another_order_between_changes_nothing);
    RUN_TEST(modes_of_exact_parameters_are_consistent);
    RUN_TEST(the_parameters_decomposed_are_near_themselves);
    RUN_TEST(sizes_say_what_can_be_asked_for);
    RUN_TEST(sizes_that_make_no_matrix_are_refused);
    RUN_TEST(orders_that_are_not_there_are_refused);
    return UNITY_END();
}
