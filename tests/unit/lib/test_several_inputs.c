// SPDX-License-Identifier: MIT
// Several forces and sensors without noise: every method, content of the Hankel matrix, solver and source of the sums
// gives the system back, D, C B, C A B .. of every force at every sensor.
#include "wide_rig.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { P = 10, ROWS = 12, N = 3000, LAST = 14 };
static const double limit = 1e-6; // of the largest; singular sums leave 1e-8

static wide_t rig;
static void* blocks[3];
static double truth[(LAST + 1) * WIDE_MOST * WIDE_MOST], found[(LAST + 1) * WIDE_MOST * WIDE_MOST];
static okid_identified_t model;
static okid_accumulator_t* accumulator;
static okid_identify_t* identifier;
static okid_square_root_t* square_root;

void setUp(void) {}
void tearDown(void) {
    for (int k = 0; k < 3; ++k) {
        free(blocks[k]);
        blocks[k] = NULL;
    }
}

/// Largest difference of Y_0 .. Y_count-1 from the true ones, over the largest of them.
static double error_of(const double* markov, int count) {
    double worst = 0, size = 0;
    for (int k = 0; k < count * rig.n_y * rig.n_u; ++k) {
        worst = fmax(worst, fabs(markov[k] - truth[k]));
        size = fmax(size, fabs(truth[k]));
    }
    return worst / size;
}

static void is_the_system(okid_method_t method) {
    wide_markov(rig.n_u, rig.n_y, model.n_z, model.A, model.B, model.C, model.D, LAST, found);
    TEST_ASSERT_EQUAL(WIDE_NZ, model.n_z);
    TEST_ASSERT_TRUE(error_of(found, LAST + 1) < limit);
    // Y_0 and those of the Hankel matrix one sample later; its correlations take four more
    TEST_ASSERT_EQUAL(2 * ROWS + 1 + (method == OKID_METHOD_OKID_ERA_DC ? 4 : 0), model.markov_count);
    for (int k = 0; k < (LAST + 1) * rig.n_y * rig.n_u; ++k) found[k] = (double)model.markov[k];
    TEST_ASSERT_TRUE(error_of(found, LAST + 1) < limit);
    TEST_ASSERT_EQUAL(WIDE_MODES, model.mode_count);
    for (int k = 0; k < WIDE_MODES; ++k) {
        TEST_ASSERT_DOUBLE_WITHIN(limit, 1, (double)model.frequency_hz[k] / wide_frequency[k]);
        TEST_ASSERT_DOUBLE_WITHIN(limit, wide_damping[k], (double)model.damping_ratio[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, (double)model.emac[k]);
    }
}

static void create(const okid_identify_config_t* c) {
    const int lags = okid_identify_lags(c);
    const okid_accumulator_config_t a = {.n_u = c->n_u, .n_y = c->n_y, .lags = lags, .forgetting = 1, .edges = 1};
    const okid_square_root_config_t q = {.n_u = c->n_u, .n_y = c->n_y, .lags = lags, .forgetting = 1};
    const size_t bytes[3] = {okid_accumulator_memsize(&a), okid_identify_memsize(c), okid_square_root_memsize(&q)};
    tearDown();
    for (int k = 0; k < 3; ++k) blocks[k] = malloc(bytes[k]);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, blocks[0], bytes[0]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, c, blocks[1], bytes[1]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&square_root, &q, blocks[2], bytes[2]));
}

/// From the Gram matrix, and from the triangular factor where `by_factor` says so.
static void identify(const okid_identify_config_t* c, const double* v, int by_factor) {
    create(c);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    is_the_system(c->method);
    if (!by_factor) return;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(square_root, v, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run_factor(identifier, square_root, &model));
    is_the_system(c->method);
}

/// Two forces and three sensors, three forces and two sensors.
static double* make(int which) {
    wide_make(&rig, 2 + which, 3 - which);
    wide_truth(&rig, LAST, truth);
    return wide_record(&rig, N, 0, 7 + (uint64_t)which);
}

static okid_identify_config_t config_of(okid_method_t method, okid_hankel_t hankel, okid_solver_t solver) {
    return (okid_identify_config_t){.n_u = rig.n_u,
                                    .n_y = rig.n_y,
                                    .p = P,
                                    .rows = ROWS,
                                    .order = WIDE_NZ,
                                    .fs_hz = WIDE_FS,
                                    .method = method,
                                    .solver = solver,
                                    .hankel = hankel};
}

static void okid_gives_the_system_whatever_its_hankel_matrix_holds(void) {
    for (int which = 0; which < 2; ++which) {
        double* v = make(which);
        for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_OKID_ERA_DC; ++method)
            for (int hankel = OKID_HANKEL_SYSTEM; hankel <= OKID_HANKEL_INNOVATIONS; ++hankel)
                for (int solver = OKID_SOLVER_DENSE; solver <= OKID_SOLVER_STRUCTURED; ++solver) {
                    const okid_identify_config_t c =
                        config_of((okid_method_t)method, (okid_hankel_t)hankel, (okid_solver_t)solver);
                    identify(&c, v, solver == OKID_SOLVER_DENSE);
                }
        free(v);
    }
}

static void subspace_methods_give_the_system(void) {
    for (int which = 0; which < 2; ++which) {
        double* v = make(which);
        for (int method = OKID_METHOD_N4SID_MOESP; method <= OKID_METHOD_N4SID_SSARX; ++method) {
            const okid_identify_config_t c = config_of((okid_method_t)method, OKID_HANKEL_SYSTEM, OKID_SOLVER_DENSE);
            identify(&c, v, 1);
        }
        free(v);
    }
}

/// The leading singular triplets alone give the poles that the whole decomposition gives; of noisy records, of any
/// order.
static void poles_need_no_whole_decomposition(void) {
    enum { MOST = 14 };
    for (int which = 0; which < 2; ++which) {
        free(make(which));
        double* v = wide_record(&rig, N, 0.3, 9);
        for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method)
            for (int hankel = OKID_HANKEL_SYSTEM; hankel <= OKID_HANKEL_LITERAL; ++hankel) {
                okid_identify_config_t c = config_of((okid_method_t)method, (okid_hankel_t)hankel, OKID_SOLVER_DENSE);
                double whole[MOST][MOST], consistent[MOST][MOST];
                int count[MOST];
                if (method >= OKID_METHOD_N4SID_MOESP && hankel != OKID_HANKEL_SYSTEM) continue;
                c.rows = 30; // large enough for it
                c.max_order = MOST;
                c.order = 4;
                create(&c);
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
                TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
                for (int order = 2; order <= MOST; order += 2) {
                    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, order, &model));
                    count[order / 2] = model.mode_count;
                    for (int k = 0; k < model.mode_count; ++k) {
                        whole[order / 2][k] = (double)model.frequency_hz[k];
                        consistent[order / 2][k] = (double)model.emac[k];
                    }
                }
                static double markov[(LAST + 1) * WIDE_MOST * WIDE_MOST];
                TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, WIDE_NZ, &model));
                wide_markov(rig.n_u, rig.n_y, WIDE_NZ, model.A, model.B, model.C, model.D, LAST, markov);
                TEST_ASSERT_EQUAL(OKID_OK, okid_identify_decompose(identifier, accumulator, &model));
                TEST_ASSERT_TRUE(model.singular_values[MOST - 1] > 0);
                // with fewer inputs than outputs a whole decomposition takes less memory, and is made
                const int leading = method == OKID_METHOD_OKID_ERA && (hankel != OKID_HANKEL_SYSTEM || which == 1);
                TEST_ASSERT_EQUAL(leading, model.singular_values[MOST] == 0);
                for (int order = 2; order <= MOST; order += 2) {
                    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, order, &model));
                    TEST_ASSERT_EQUAL(count[order / 2], model.mode_count);
                    for (int k = 0; k < model.mode_count; ++k) {
                        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * WIDE_FS, whole[order / 2][k], (double)model.frequency_hz[k]);
                        TEST_ASSERT_DOUBLE_WITHIN(1e-4, consistent[order / 2][k], (double)model.emac[k]);
                    }
                }
                TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, WIDE_NZ, &model)); // a whole model
                wide_markov(rig.n_u, rig.n_y, WIDE_NZ, model.A, model.B, model.C, model.D, LAST, found);
                for (int k = 0; k < (LAST + 1) * rig.n_u * rig.n_y; ++k)
                    TEST_ASSERT_DOUBLE_WITHIN(1e-6, markov[k], found[k]);
            }
        free(v);
    }
}

/// Without forces: a sensor that says what two others say together leaves the modes as they are.
static void a_redundant_sensor_does_no_harm(void) {
    enum { LONG = 30000 };
    wide_make(&rig, 2, 3);
    double *v = wide_record(&rig, LONG, 0, 3), *y = malloc(sizeof *y * LONG * 3);
    for (int n = 0; n < LONG; ++n) {
        y[n * 3] = v[n * 5 + 2] - rig.D[0] * v[n * 5] - rig.D[3] * v[n * 5 + 1];
        y[n * 3 + 1] = v[n * 5 + 3] - rig.D[1] * v[n * 5] - rig.D[4] * v[n * 5 + 1];
        y[n * 3 + 2] = y[n * 3] + y[n * 3 + 1];
    }
    rig.n_u = 0;
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_OKID_ERA_DC; ++method) {
        okid_identify_config_t c = config_of((okid_method_t)method, OKID_HANKEL_SYSTEM, OKID_SOLVER_DENSE);
        c.rows = 40;
        create(&c);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, y, LONG));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
        TEST_ASSERT_EQUAL(WIDE_MODES, model.mode_count);
        for (int k = 0; k < WIDE_MODES; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(0.01, 1, (double)model.frequency_hz[k] / wide_frequency[k]);
    }
    free(v);
    free(y);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(okid_gives_the_system_whatever_its_hankel_matrix_holds);
    RUN_TEST(subspace_methods_give_the_system);
    RUN_TEST(poles_need_no_whole_decomposition);
    RUN_TEST(a_redundant_sensor_does_no_harm);
    return UNITY_END();
}
