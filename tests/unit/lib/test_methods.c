// SPDX-License-Identifier: MIT
// All five methods through okid_identify_run(): the same three modes, and what belongs to one family only.
#include "identify_bench.h"
#include "tolerance.h"

#include <okid/steps/era.h>

enum { P = 20, N = 6000 };

static const double frequency_limit = TOLERANCE(1e-10, 2e-5), damping_limit = TOLERANCE(1e-8, 2e-2);
static const double noisy_frequency = 5e-4, noisy_damping = 5e-2;

static const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_OKID_ERA_DC, OKID_METHOD_N4SID_MOESP,
                                        OKID_METHOD_N4SID_CVA, OKID_METHOD_N4SID_SSARX};
enum { METHODS = sizeof methods / sizeof *methods };

static okid_identify_config_t config_of(okid_method_t method, int n_u, int order) {
    const okid_identify_config_t c = {
        .n_u = n_u, .n_y = RIG_NY, .p = P, .rows = 30, .order = order, .fs_hz = RIG_FS, .method = method};
    return c;
}

static void expect_modes(double frequency_error, double damping_error, double emac, const char* what) {
    TEST_ASSERT_EQUAL_MESSAGE(RIG_MODES, model.mode_count, what);
    for (int k = 0; k < RIG_MODES; ++k) {
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(frequency_error * rig_frequency[k], rig_frequency[k], model.frequency_hz[k],
                                          what);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(damping_error * rig_damping[k], rig_damping[k], model.damping_ratio[k], what);
        TEST_ASSERT_TRUE(model.emac[k] > emac && model.emac[k] <= 1.001);
    }
}

static const char* name_of(int k, const char* form) {
    static char text[64];
    snprintf(text, sizeof text, "method %d, %s, %s", k, form, okid_backend());
    return text;
}

static void run_by_factor(const double* v) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(square_root, v, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run_factor(identifier, square_root, &model));
}

static void run_by_sums(const double* v) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
}

static void every_method_finds_the_modes_without_noise(void) {
    double* v = rig_record(&rig, N, 0, NULL, 1);
    for (int k = 0; k < METHODS; ++k) {
        const okid_identify_config_t config = config_of(methods[k], RIG_NU, RIG_NZ);
        create(&config);
        run_by_factor(v);
        expect_modes(frequency_limit, damping_limit, 0.9, name_of(k, "factor"));
        run_by_sums(v);
        expect_modes(frequency_limit, TOLERANCE(1e-7, 2e-2), 0.9, name_of(k, "gram"));
        TEST_ASSERT_TRUE(model.warnings & OKID_NOTE_ILL_CONDITIONED);
    }
    free(v);
}

/// Y_k of the result against D, C A^(k-1) B of its own matrices.
static double markov_mismatch(void) {
    double worst = 0, state[RIG_NZ], next[RIG_NZ], size = 0;
    for (int i = 0; i < RIG_NZ; ++i) state[i] = model.B[i];
    for (int k = 0; k < model.markov_count; ++k) {
        for (int o = 0; o < RIG_NY; ++o) {
            double y = 0;
            for (int i = 0; k > 0 && i < RIG_NZ; ++i) y += model.C[i * RIG_NY + o] * state[i];
            if (k == 0) y = model.D[o];
            size = fmax(size, fabs(y));
            worst = fmax(worst, fabs(y - model.markov[k * RIG_NY + o]));
        }
        if (k == 0) continue;
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += model.A[j * RIG_NZ + i] * state[j];
        }
        for (int i = 0; i < RIG_NZ; ++i) state[i] = next[i];
    }
    return worst / size;
}

static void every_method_chooses_the_order_in_noise(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 11);
    for (int k = 0; k < METHODS; ++k) {
        const okid_identify_config_t config = config_of(methods[k], RIG_NU, 0);
        const int n4sid = methods[k] >= OKID_METHOD_N4SID_MOESP;
        create(&config);
        TEST_ASSERT_EQUAL(n4sid ? 59 : P, okid_identify_lags(&config));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
        const okid_status_t status = okid_identify_run(identifier, accumulator, &model);
        TEST_ASSERT_GREATER_OR_EQUAL_MESSAGE(0, status, name_of(k, "auto"));
        TEST_ASSERT_EQUAL(0, model.warnings & ~(uint32_t)OKID_NOTE_ORDER_UNCLEAR);
        TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
        TEST_ASSERT_EQUAL(30, model.rows);
        TEST_ASSERT_EQUAL(n4sid ? 30 : P, model.p);
        TEST_ASSERT_EQUAL(n4sid, model.observer == NULL);
        TEST_ASSERT_GREATER_OR_EQUAL(61, model.markov_count);
        expect_modes(noisy_frequency, noisy_damping, 0.9, name_of(k, "auto"));
        for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_TRUE(model.innovation[o * (RIG_NY + 1)] > 0);
        TEST_ASSERT_TRUE(markov_mismatch() < (n4sid ? TOLERANCE(1e-12, 1e-5) : 0.03));
        for (int n = 1; n < model.singular_count; ++n)
            TEST_ASSERT_TRUE(model.singular_values[n] <= model.singular_values[n - 1]);
        for (int order = 2; order <= 20; order += 2) {
            const okid_status_t other = okid_identify_order(identifier, order, &model);
            TEST_ASSERT_TRUE(other >= 0 || other == OKID_ERR_NO_MODES);
            TEST_ASSERT_EQUAL(order, model.n_z);
        }
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_identify_order(identifier, okid_identify_max_order(&config) + 1, &model));
    }
    free(v);
}

/// A fixed order is all that is decomposed for; others come on demand, as from a decomposition for them.
static void other_orders_than_the_one_asked_for(void) {
    enum { MORE = 14 };
    double *v = rig_record(&rig, N, 0.01, NULL, 7), f[2][MORE], radius[2], few[RIG_MODES];
    for (int k = 0; k < METHODS; ++k) {
        for (int way = 0; way < 2; ++way) {
            const okid_identify_config_t config = config_of(methods[k], RIG_NU, way == 0 ? RIG_NZ : MORE);
            create(&config);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
            for (int m = 0; way == 0 && m < RIG_MODES; ++m) few[m] = model.frequency_hz[m];
            if (way == 0) TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, MORE, &model));
            TEST_ASSERT_EQUAL(MORE, model.n_z);
            for (int m = 0; m < model.mode_count; ++m) f[way][m] = model.frequency_hz[m];
            radius[way] = model.model_radius;
        }
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(TOLERANCE(1e-8, 1e-2), radius[1], radius[0], name_of(k, "radius"));
        for (int m = 0; m < model.mode_count; ++m)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(TOLERANCE(1e-6, 1e-1) * f[1][m], f[1][m], f[0][m], // noise: near values
                                              name_of(k, "orders"));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, RIG_NZ, &model));
        for (int m = 0; m < RIG_MODES; ++m)
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-9, 1e-3) * few[m], few[m], model.frequency_hz[m]);
    }
    free(v);
}

static void ambient_records_have_modes_and_a_predictor(void) {
    enum { LONG = 4 * N };
    double *v = rig_record(&rig, LONG, 0.01, NULL, 5), *y = malloc(sizeof(double) * LONG * RIG_NY);
    for (int n = 0; n < LONG; ++n)
        for (int o = 0; o < RIG_NY; ++o) y[n * RIG_NY + o] = v[n * RIG_M + RIG_NU + o];
    for (int k = 0; k < METHODS; ++k) {
        okid_identify_config_t config = config_of(methods[k], 0, RIG_NZ);
        config.rows = 60;
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, y, LONG));
        TEST_ASSERT_EQUAL_MESSAGE(OKID_OK, okid_identify_run(identifier, accumulator, &model), name_of(k, "ambient"));
        expect_modes(1e-2, 0.5, 0.5, name_of(k, "ambient"));
        TEST_ASSERT_EQUAL(0, model.markov_count);
        TEST_ASSERT_EQUAL(0, model.n_u);
        TEST_ASSERT_EQUAL(60, model.p);
        TEST_ASSERT_NULL(model.observer);
        for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_TRUE(model.innovation[o * (RIG_NY + 1)] > 0);
    }
    free(v);
    free(y);
}

static void inputs_can_be_replaced(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 11);
    okid_real_t B[RIG_NZ * RIG_NU], D[RIG_NY * RIG_NU];
    for (int k = 0; k < RIG_NZ; ++k) B[k] = (okid_real_t)(k + 1);
    for (int k = 0; k < RIG_NY; ++k) D[k] = (okid_real_t)(-k);
    for (int k = 0; k < METHODS; ++k) {
        const okid_identify_config_t config = config_of(methods[k], RIG_NU, RIG_NZ);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
        TEST_ASSERT_EQUAL(OKID_OK, okid_identify_run(identifier, accumulator, &model));
        const okid_status_t status = okid_identify_set_inputs(identifier, B, D, &model);
        TEST_ASSERT_EQUAL(methods[k] >= OKID_METHOD_N4SID_MOESP ? OKID_OK : OKID_ERR_MISMATCH, status);
        if (status != OKID_OK) continue;
        TEST_ASSERT_EQUAL_MEMORY(B, model.B, sizeof B);
        TEST_ASSERT_EQUAL_MEMORY(D, model.markov, sizeof D);
        TEST_ASSERT_TRUE(markov_mismatch() < TOLERANCE(1e-12, 1e-5));
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_identify_set_inputs(identifier, NULL, D, &model));
        const int32_t states[] = {1, RIG_NZ, 0, -1, okid_identify_max_order(&config) + 1}; // one is enough
        for (int n = 0; n < 5; ++n) {
            model.n_z = states[n];
            TEST_ASSERT_EQUAL(n < 2 ? OKID_OK : OKID_ERR_MISMATCH, okid_identify_set_inputs(identifier, B, D, &model));
        }
    }
    free(v);
}

/// Both say that it costs digits. That of a factor comes from its pivots, which tell the least it can be.
static void both_ways_know_the_condition(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 11);
    for (int k = 0; k < METHODS; ++k) {
        const okid_identify_config_t config = config_of(methods[k], RIG_NU, RIG_NZ);
        create(&config);
        run_by_factor(v);
        const double least = model.observer_info.condition;
        run_by_sums(v);
        TEST_ASSERT_TRUE(least > 100 && least < model.observer_info.condition);
    }
    free(v);
}

/// Sensors that show the force itself, but for the last digits: what is left has poles and no dynamics.
static void a_loop_of_cable_has_no_modes(void) {
    uint64_t seed = 31;
    double* v = rig_record(&rig, N, 0, NULL, 11);
    for (int n = 0; n < N; ++n)
        for (int o = 0; o < RIG_NY; ++o)
            v[n * RIG_M + RIG_NU + o] = (o - 3) * v[n * RIG_M] + TOLERANCE(1e-11, 1e-6) * rig_normal(&seed);
    for (int k = 0; k < METHODS; ++k) {
        const okid_identify_config_t config = config_of(methods[k], RIG_NU, RIG_NZ);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
        TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_NO_MODES, okid_identify_run(identifier, accumulator, &model),
                                  name_of(k, "cable"));
    }
    free(v);
}

static void what_does_not_fit_is_refused(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 11);
    okid_identify_config_t config = config_of(OKID_METHOD_N4SID_CVA, RIG_NU, 0), other = config;
    create(&config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, 100));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_identify_run_factor(identifier, square_root, &model));
    other.rows = 29; // an accumulator of 59 lags
    const size_t bytes = okid_identify_memsize(&other);
    void* block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &other, block, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_run_factor(identifier, square_root, &model));
    free(block);
    other.rows = 0;
    TEST_ASSERT_EQUAL(59, okid_identify_lags(&other)); // 30 block rows unless said otherwise
    TEST_ASSERT_EQUAL(0, okid_identify_lags(NULL));
    okid_identify_config_t bad[] = {config, config, config, config};
    bad[0].rows = 1;
    bad[1].solver = OKID_SOLVER_STRUCTURED;
    bad[2].method = (okid_method_t)5;
    bad[3].rows = 8000; // 2 i m above what the subspace takes
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) {
        TEST_ASSERT_EQUAL(0, okid_identify_memsize(&bad[k]));
        TEST_ASSERT_EQUAL(0, okid_identify_lags(&bad[k]));
        TEST_ASSERT_EQUAL(0, okid_identify_max_order(&bad[k]));
    }
    free(v);
}

static void a_constant_channel_is_named(void) {
    for (int channel = 0; channel < RIG_M; ++channel) {
        double* v = rig_record(&rig, N, 0.01, NULL, 11);
        for (int n = 0; n < N; ++n) v[n * RIG_M + channel] = 3;
        for (int k = 0; k < METHODS; ++k) {
            const okid_identify_config_t config = config_of(methods[k], RIG_NU, 0);
            const okid_status_t expected = channel < RIG_NU ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
            create(&config);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
            TEST_ASSERT_EQUAL(expected, okid_identify_run(identifier, accumulator, &model));
            TEST_ASSERT_EQUAL(channel, model.observer_info.channel);
            TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(square_root, v, N));
            TEST_ASSERT_EQUAL(expected, okid_identify_run_factor(identifier, square_root, &model));
            TEST_ASSERT_EQUAL(channel, model.observer_info.channel);
        }
        free(v);
    }
}

// The correlations UU(0) formed literally, for a small system: trace of UU UU^T is the sum of the squared singular values,
// and ERA/DC realizes exact Markov parameters exactly.
static void correlations_are_those_of_the_definition(void) {
    enum { R = 6, C = 5, XI = 2, ZETA = 1, TAU = 2, LAST = R + C + (XI + ZETA) * TAU, H = R * RIG_NY };
    const okid_era_config_t config = {RIG_NU, RIG_NY, R, C, XI, ZETA, TAU};
    okid_real_t markov[(LAST + 1) * RIG_NY], A[RIG_NZ * RIG_NZ], B[RIG_NZ], Cm[RIG_NY * RIG_NZ];
    double state[RIG_NZ], next[RIG_NZ], total = 0, sum = 0;
    TEST_ASSERT_EQUAL(LAST, okid_era_markov_last(&config));
    for (int o = 0; o < RIG_NY; ++o) markov[o] = rig.D[o];
    for (int i = 0; i < RIG_NZ; ++i) state[i] = rig.B[i];
    for (int k = 1; k <= LAST; ++k) {
        for (int o = 0; o < RIG_NY; ++o) {
            double y = 0;
            for (int i = 0; i < RIG_NZ; ++i) y += (double)rig.C[i * RIG_NY + o] * state[i];
            markov[k * RIG_NY + o] = (okid_real_t)y;
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += (double)rig.A[j * RIG_NZ + i] * state[j];
        }
        for (int i = 0; i < RIG_NZ; ++i) state[i] = next[i];
    }
    for (int a = 0; a <= XI; ++a)
        for (int b = 0; b <= ZETA; ++b)
            for (int y = 0; y < H; ++y)
                for (int x = 0; x < H; ++x) {
                    double entry = 0; // of H((a+b) tau) H(0)^T
                    for (int j = 0; j < C; ++j)
                        entry += (double)markov[(y / RIG_NY + j + 1 + (a + b) * TAU) * RIG_NY + y % RIG_NY] *
                                 (double)markov[(x / RIG_NY + j + 1) * RIG_NY + x % RIG_NY];
                    total += entry * entry;
                }
    const size_t bytes = okid_era_memsize(&config);
    void* block = malloc(bytes);
    okid_era_t* era;
    int32_t count;
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_create(&era, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
    const okid_real_t* values = okid_era_singular_values(era, &count);
    for (int k = 0; k < count; ++k) sum += (double)values[k] * (double)values[k];
    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5) * total, total, sum);
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, RIG_NZ, A, B, Cm, NULL, NULL));
    double size = 0, worst = 0;
    for (int i = 0; i < RIG_NZ; ++i) state[i] = B[i];
    for (int k = 1; k <= LAST; ++k) {
        for (int o = 0; o < RIG_NY; ++o) {
            double y = 0;
            for (int i = 0; i < RIG_NZ; ++i) y += (double)Cm[i * RIG_NY + o] * state[i];
            worst = fmax(worst, fabs(y - (double)markov[k * RIG_NY + o]));
            size = fmax(size, fabs((double)markov[k * RIG_NY + o]));
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += (double)A[j * RIG_NZ + i] * state[j];
        }
        for (int i = 0; i < RIG_NZ; ++i) state[i] = next[i];
    }
    TEST_ASSERT_TRUE(worst < TOLERANCE(1e-9, 5e-2) * size);
    free(block);
    const okid_era_config_t bad[] = {{RIG_NU, RIG_NY, R, C, 2, 0, 0},
                                     {RIG_NU, RIG_NY, R, C, 2, 2, C + 1},
                                     {RIG_NU, RIG_NY, R, C, -1, 2, 1},
                                     {RIG_NU, RIG_NY, R, C, 2, 65, 1}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) TEST_ASSERT_EQUAL(0, okid_era_memsize(&bad[k]));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(every_method_finds_the_modes_without_noise);
    RUN_TEST(every_method_chooses_the_order_in_noise);
    RUN_TEST(other_orders_than_the_one_asked_for);
    RUN_TEST(ambient_records_have_modes_and_a_predictor);
    RUN_TEST(inputs_can_be_replaced);
    RUN_TEST(both_ways_know_the_condition);
    RUN_TEST(a_loop_of_cable_has_no_modes);
    RUN_TEST(what_does_not_fit_is_refused);
    RUN_TEST(a_constant_channel_is_named);
    RUN_TEST(correlations_are_those_of_the_definition);
    return UNITY_END();
}
