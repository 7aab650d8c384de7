// SPDX-License-Identifier: MIT
// What okid-era puts into its Hankel matrix: system, innovations or eq. 42 literally, and covariances where there are no
// inputs. All against known modes; units must not matter except in the literal form, which says so.
#include "identify_bench.h"
#include "tolerance.h"

#include <okid/steps/era.h>

enum { P = 20, N = 6000, LONG = 24000, ROWS = 40 };

static okid_identify_config_t config_of(okid_method_t method, okid_hankel_t hankel, int n_u) {
    const okid_identify_config_t c = {.n_u = n_u,
                                      .n_y = RIG_NY,
                                      .p = P,
                                      .rows = ROWS,
                                      .order = RIG_NZ,
                                      .fs_hz = RIG_FS,
                                      .method = method,
                                      .hankel = hankel};
    return c;
}

static void run(const okid_identify_config_t* config, const double* v, int count) {
    create(config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, (size_t)count));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(RIG_MODES, model.mode_count);
}

/// Worst relative error of the damping ratios.
static double damping_error(void) {
    double worst = 0;
    for (int k = 0; k < RIG_MODES; ++k) worst = fmax(worst, fabs((double)model.damping_ratio[k] / rig_damping[k] - 1));
    return worst;
}

static double frequency_error(void) {
    double worst = 0;
    for (int k = 0; k < RIG_MODES; ++k) worst = fmax(worst, fabs((double)model.frequency_hz[k] / rig_frequency[k] - 1));
    return worst;
}

static double* scaled(const double* v, int count, double factor) {
    double* out = malloc(sizeof *out * (size_t)count * RIG_M);
    for (int k = 0; k < count * RIG_M; ++k) out[k] = v[k] * (k % RIG_M < RIG_NU ? factor : 1);
    return out;
}

static void trap_01_without_noise_only_the_literal_form_is_wrong(void) {
    double* v = rig_record(&rig, N, 0, NULL, 3);
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_OKID_ERA_DC; ++method)
        for (int hankel = OKID_HANKEL_SYSTEM; hankel <= OKID_HANKEL_LITERAL; ++hankel) {
            const okid_identify_config_t c = config_of((okid_method_t)method, (okid_hankel_t)hankel, RIG_NU);
            const int literal = hankel == OKID_HANKEL_LITERAL;
            for (int factor = 0; factor < 2; ++factor) {
                run(&c, v, N);
                if (factor) {
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(square_root, v, N));
                    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run_factor(identifier, square_root, &model));
                }
                TEST_ASSERT_EQUAL(literal, (model.warnings & OKID_NOTE_LITERAL_HANKEL) != 0);
                const double error = damping_error();
                TEST_ASSERT_TRUE(literal ? error > 5e-3 : error < TOLERANCE(1e-7, 2e-2));
                for (int o = 0; !literal && o < RIG_NY; ++o) { // D and C B say whether B has the right units
                    double first = 0, truth = 0;
                    for (int i = 0; i < RIG_NZ; ++i) {
                        first += (double)model.C[i * RIG_NY + o] * (double)model.B[i];
                        truth += rig.C[i * RIG_NY + o] * rig.B[i];
                    }
                    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-8, 1e-3), truth, first);
                }
            }
        }
    free(v);
}

static void trap_01_units_matter_in_the_literal_form_only(void) {
    double *v = rig_record(&rig, N, 0.01, NULL, 3), *newton = scaled(v, N, 1e3);
    const okid_solver_t solvers[] = {OKID_SOLVER_DENSE, OKID_SOLVER_STRUCTURED};
    for (int s = 0; s < 2; ++s) {
        okid_identify_config_t c = config_of(OKID_METHOD_OKID_ERA, OKID_HANKEL_INNOVATIONS, RIG_NU);
        c.solver = solvers[s];
        run(&c, v, N);
        const double base = damping_error();
        TEST_ASSERT_TRUE(base < 0.03 && frequency_error() < 5e-4);
        TEST_ASSERT_EQUAL(0, model.warnings);
        const okid_real_t gain = model.K[0], shape = model.C[0] * model.B[0];
        run(&c, newton, N);
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-8, 1e-3), base, damping_error());
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-6, 1e-2) * fabs((double)gain), (double)gain, (double)model.K[0]);
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-6, 1e-2) * fabs((double)shape), (double)shape,
                                  1e3 * (double)(model.C[0] * model.B[0]));
        c.hankel = OKID_HANKEL_LITERAL;
        run(&c, v, N);
        TEST_ASSERT_EQUAL(OKID_NOTE_LITERAL_HANKEL, model.warnings & OKID_NOTE_LITERAL_HANKEL);
        const double in_newton = damping_error();
        run(&c, newton, N);
        TEST_ASSERT_TRUE(in_newton > 3 * base && fabs(damping_error() / in_newton - 1) > 0.05);
    }
    TEST_ASSERT_EQUAL_STRING("literal_hankel", okid_warning_code(OKID_NOTE_LITERAL_HANKEL));
    free(v);
    free(newton);
}

static void cmi_is_emac_times_mpc(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 3);
    const okid_identify_config_t c = config_of(OKID_METHOD_OKID_ERA, OKID_HANKEL_SYSTEM, RIG_NU);
    run(&c, v, N);
    for (int k = 0; k < RIG_MODES; ++k) TEST_ASSERT_TRUE(model.cmi[k] == model.emac[k] * model.mpc[k]);
    TEST_ASSERT_TRUE(model.cmi[0] > 0 && model.mpc[0] < 1);
    free(v);
}

/// The outputs of a record whose force nobody measured, the first in other units.
static double* outputs_of(const double* v, int count, double unit) {
    double* y = malloc(sizeof *y * (size_t)count * RIG_NY);
    for (int n = 0; n < count; ++n)
        for (int o = 0; o < RIG_NY; ++o) y[n * RIG_NY + o] = v[n * RIG_M + RIG_NU + o] * (o == 0 ? unit : 1);
    return y;
}

static void without_inputs_the_covariances_are_realized(void) {
    double* v = rig_record(&rig, LONG, 0.01, NULL, 5);
    double *y = outputs_of(v, LONG, 1), *other = outputs_of(v, LONG, 1e4);
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_OKID_ERA_DC; ++method) {
        okid_identify_config_t c = config_of((okid_method_t)method, OKID_HANKEL_SYSTEM, 0);
        TEST_ASSERT_EQUAL(2 * ROWS + (method == OKID_METHOD_OKID_ERA_DC ? 4 : 0), okid_identify_lags(&c));
        run(&c, y, LONG);
        TEST_ASSERT_EQUAL(0, model.warnings); // the predictor is stable too
        TEST_ASSERT_TRUE(frequency_error() < 5e-3);
        TEST_ASSERT_TRUE(damping_error() < 0.35); // 24000 samples are 960 cycles of the first mode
        TEST_ASSERT_EQUAL(0, model.markov_count);
        TEST_ASSERT_NULL(model.observer);
        TEST_ASSERT_EQUAL(ROWS, model.p);
        double base[RIG_MODES], gain[RIG_NY], noise = (double)model.innovation[0];
        TEST_ASSERT_TRUE(noise > 0);
        for (int k = 0; k < RIG_MODES; ++k) base[k] = (double)model.damping_ratio[k];
        for (int o = 0; o < RIG_NY; ++o) gain[o] = (double)model.C[o] * (double)model.K[o * RIG_NZ];
        run(&c, other, LONG);
        for (int k = 0; k < RIG_MODES; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-8, 1e-3) * base[k], base[k], (double)model.damping_ratio[k]);
        for (int o = 0; o < RIG_NY; ++o)
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-6, 2e-2) * fabs(gain[o]), gain[o],
                                      (double)model.C[o] * (double)model.K[o * RIG_NZ]);
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-6, 1e-2) * noise, noise, (double)model.innovation[0] / 1e8);
        c.order = c.p = 0; // p says nothing here
        run(&c, y, LONG);
        TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_identify_run_factor(identifier, square_root, &model));
    }
    free(v);
    free(y);
    free(other);
}

static void what_does_not_fit_is_refused(void) {
    okid_identify_config_t c = config_of(OKID_METHOD_OKID_ERA, OKID_HANKEL_SYSTEM, 0);
    c.rows = 0;
    TEST_ASSERT_EQUAL(2 * P, okid_identify_lags(&c)); // p block rows
    c.p = 0;
    TEST_ASSERT_EQUAL(0, okid_identify_memsize(&c));
    c.rows = ROWS;
    TEST_ASSERT_EQUAL(2 * ROWS, okid_identify_lags(&c));
    okid_identify_config_t bad[] = {c, c, config_of(OKID_METHOD_N4SID_CVA, OKID_HANKEL_INNOVATIONS, RIG_NU),
                                    config_of(OKID_METHOD_OKID_ERA, (okid_hankel_t)3, RIG_NU)};
    bad[0].solver = OKID_SOLVER_STRUCTURED;
    bad[1].hankel = OKID_HANKEL_INNOVATIONS;
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) TEST_ASSERT_EQUAL(0, okid_identify_memsize(&bad[k]));
    create(&c);
    double* y = calloc((size_t)N * RIG_NY, sizeof *y);
    for (int n = 0; n < N; ++n) y[n * RIG_NY] = y[n * RIG_NY + 2] = sin(0.3 * n) + 0.1 * cos(1.1 * n);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, y, 100));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, y + 100 * RIG_NY, N - 100));
    TEST_ASSERT_EQUAL(OKID_ERR_OUTPUT, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(1, model.observer_info.channel);
    free(y);
}

enum { NEAR_ROWS = 12, NEAR_LAST = 2 * NEAR_ROWS };

/// Modes of A and C; the frequencies and damping ratios go to `out`.
static void poles_of(const okid_real_t* A, const okid_real_t* C, double* out) {
    static okid_real_t f[RIG_MODES], zeta[RIG_MODES];
    const size_t bytes = okid_modal_memsize(RIG_NY, RIG_NZ);
    char* work = malloc(bytes);
    const okid_model_t its = {.n_u = RIG_NU, .n_y = RIG_NY, .n_z = RIG_NZ, .A = A, .C = C};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta};
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&its, 1 / RIG_FS, &modes, work, bytes));
    free(work);
    TEST_ASSERT_EQUAL(RIG_MODES, modes.count);
    for (int k = 0; k < RIG_MODES; ++k) {
        out[2 * k] = (double)f[k];
        out[2 * k + 1] = (double)zeta[k];
    }
}

/// Markov parameters of the rig with noise: what is left out by the order is not zero. `step` of another noise beside.
static void noisy_markov(double step, okid_real_t* out) {
    uint64_t state = 11, other = 12;
    double size = 0;
    for (int k = 0; k <= NEAR_LAST; ++k) {
        double clean[RIG_NY * RIG_NU];
        rig_markov(&rig, k, clean);
        for (int i = 0; i < RIG_NY * RIG_NU; ++i) {
            size = fmax(size, fabs(clean[i]));
            out[k * RIG_NY * RIG_NU + i] =
                (okid_real_t)(clean[i] + size * (1e-3 * rig_normal(&state) + step * rig_normal(&other)));
        }
    }
}

static void near_parameters_move_the_poles_as_a_decomposition_does(void) {
    const okid_era_config_t c = okid_era_defaults(RIG_NU, RIG_NY, NEAR_ROWS);
    static okid_real_t markov[(NEAR_LAST + 1) * RIG_NY * RIG_NU], A[RIG_NZ * RIG_NZ], B[RIG_NZ * RIG_NU],
        C[RIG_NY * RIG_NZ], near_A[RIG_NZ * RIG_NZ], near_C[RIG_NY * RIG_NZ];
    double before[2 * RIG_MODES], by_step[2 * RIG_MODES], by_decomposing[2 * RIG_MODES];
    void* block = malloc(okid_era_memsize(&c));
    okid_era_t* era = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_create(&era, &c, block, okid_era_memsize(&c)));
    noisy_markov(0, markov);
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, RIG_NZ, A, B, C, NULL, NULL));
    poles_of(A, C, before);
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize_near(era, RIG_NZ, markov, near_A, near_C));
    for (int k = 0; k < RIG_NZ * RIG_NZ; ++k)
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5), (double)A[k], (double)near_A[k]);
    for (int k = 0; k < RIG_NY * RIG_NZ; ++k)
        TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5), (double)C[k], (double)near_C[k]);
    noisy_markov(TOLERANCE(1e-5, 1e-3), markov);
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize_near(era, RIG_NZ, markov, near_A, near_C));
    poles_of(near_A, near_C, by_step);
    TEST_ASSERT_EQUAL(OKID_OK,
                      okid_era_realize(era, RIG_NZ, A, B, C, NULL, NULL)); // what was decomposed is still there
    poles_of(A, C, by_decomposing);
    for (int k = 0; k < 2 * RIG_MODES; ++k) TEST_ASSERT_EQUAL_DOUBLE(before[k], by_decomposing[k]);
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
    TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, RIG_NZ, A, B, C, NULL, NULL));
    poles_of(A, C, by_decomposing);
    for (int k = 0; k < 2 * RIG_MODES; ++k) {
        const double change = by_decomposing[k] - before[k];
        TEST_ASSERT_DOUBLE_WITHIN(0.05 * fabs(change), change, by_step[k] - before[k]);
    }
    free(block);
}

static void near_parameters_of_correlations_and_wrong_orders_are_refused(void) {
    okid_era_config_t c = okid_era_defaults(RIG_NU, RIG_NY, NEAR_ROWS);
    static okid_real_t markov[(NEAR_LAST + 1) * RIG_NY * RIG_NU], A[RIG_NZ * RIG_NZ], C[RIG_NY * RIG_NZ];
    noisy_markov(0, markov);
    for (c.tau = 0; c.tau < 2; ++c.tau) {
        void* block = malloc(okid_era_memsize(&c));
        okid_era_t* era = NULL;
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_create(&era, &c, block, okid_era_memsize(&c)));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov));
        TEST_ASSERT_EQUAL(c.tau ? OKID_ERR_DIM : OKID_OK, okid_era_realize_near(era, RIG_NZ, markov, A, C));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize_near(era, 0, markov, A, C));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_era_realize_near(era, okid_era_max_order(&c) + 1, markov, A, C));
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_era_realize_near(NULL, RIG_NZ, markov, A, C));
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_era_realize_near(era, RIG_NZ, markov, A, NULL));
        free(block);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(trap_01_without_noise_only_the_literal_form_is_wrong);
    RUN_TEST(trap_01_units_matter_in_the_literal_form_only);
    RUN_TEST(cmi_is_emac_times_mpc);
    RUN_TEST(without_inputs_the_covariances_are_realized);
    RUN_TEST(what_does_not_fit_is_refused);
    RUN_TEST(near_parameters_move_the_poles_as_a_decomposition_does);
    RUN_TEST(near_parameters_of_correlations_and_wrong_orders_are_refused);
    return UNITY_END();
}
