// SPDX-License-Identifier: MIT
// From samples to modes: ERA, modal analysis, model simulation, and the one call that joins them.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 20, N = 6000 };

// Limits, float ones 3 to 5 times the worst measured on both backends. In float a pole keeps its place to about 1e-7, which
// is 1e-7/(1 - |mu|) of its damping: 4e-5 for the slowest mode of the rig before anything else is rounded.
static const double frequency_limit = TOLERANCE(1e-10, 8e-7), damping_limit = TOLERANCE(1e-7, 1.2e-3);
static const double feedthrough_limit = TOLERANCE(1e-9, 5e-8); // D is read off theta
static const double pole_limit = TOLERANCE(1e-9, 3e-6);        // Hz: a few roundings of 11 Hz
static const double repeated_limit = TOLERANCE(1e-11, 1.5e-5); // state of a mode that stands twice
static const double unit_limit = TOLERANCE(1e-12, 5e-7);       // what is 1 by definition

static rig_t rig;
static void* blocks[2];
static okid_accumulator_t* accumulator;
static okid_identify_t* identifier;
static okid_identified_t model;

void setUp(void) { rig_make(&rig); }

void tearDown(void) {
    free(blocks[0]);
    free(blocks[1]);
    blocks[0] = blocks[1] = NULL;
}

static void prepare(const double* v, int count, int order, okid_detrend_t detrend) {
    const okid_accumulator_config_t a = {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 1, 0};
    const okid_identify_config_t c = {RIG_NU, RIG_NY, P, 0, order, 0, RIG_FS, OKID_METHOD_OKID_ERA, detrend};
    const size_t bytes[2] = {okid_accumulator_memsize(&a), okid_identify_memsize(&c)};
    tearDown();
    for (int i = 0; i < 2; ++i) blocks[i] = malloc(bytes[i]);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, blocks[0], bytes[0]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, blocks[1], bytes[1]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, (size_t)count));
}

static void expect_modes(double frequency_error, double damping_error) {
    TEST_ASSERT_EQUAL(RIG_MODES, model.mode_count);
    for (int k = 0; k < RIG_MODES; ++k) {
        TEST_ASSERT_DOUBLE_WITHIN(frequency_error * rig_frequency[k], rig_frequency[k], model.frequency_hz[k]);
        TEST_ASSERT_DOUBLE_WITHIN(damping_error * rig_damping[k], rig_damping[k], model.damping_ratio[k]);
        TEST_ASSERT_TRUE(model.emac[k] > 0.95 && model.emac[k] <= 1 + unit_limit);
        TEST_ASSERT_TRUE(model.mpc[k] >= 0 && model.mpc[k] <= 1 + unit_limit);
        double largest = 0;
        for (int o = 0; o < RIG_NY; ++o)
            largest = fmax(largest, hypot(model.shape_re[k * RIG_NY + o], model.shape_im[k * RIG_NY + o]));
        TEST_ASSERT_DOUBLE_WITHIN(unit_limit, 1, largest);
    }
}

static void noise_free_modes_to_the_last_digits(void) {
    double* v = rig_record(&rig, N, 0, NULL, 1);
    prepare(v, N, 0, OKID_DETREND_NONE);
    const okid_status_t status = okid_identify_run(identifier, accumulator, &model);
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, status);
    TEST_ASSERT_TRUE(model.warnings & OKID_NOTE_ILL_CONDITIONED);
    TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
    expect_modes(frequency_limit, damping_limit);
    for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_DOUBLE_WITHIN(feedthrough_limit, rig.D[o], model.D[o]);
    free(v);
}

static void noisy_modes_and_offsets(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 11);
    for (int i = 0; i < N * RIG_M; ++i) v[i] += 100 * (1 + i % RIG_M);
    prepare(v, N, 0, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(RIG_NZ, model.n_z);
    expect_modes(5e-4, 5e-2);
    for (int c = 0; c < RIG_M; ++c) TEST_ASSERT_DOUBLE_WITHIN(2, 100 * (1 + c), model.mean[c]);
    free(v);
}

static void over_order_keeps_the_true_modes_and_marks_the_others(void) {
    double* v = rig_record(&rig, N, 0.02, NULL, 12);
    prepare(v, N, 16, OKID_DETREND_MEAN);
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(16, model.n_z);
    int consistent = 0;
    for (int k = 0; k < model.mode_count; ++k) {
        consistent += model.emac[k] > 0.9;
        TEST_ASSERT_TRUE(k == 0 || model.frequency_hz[k] >= model.frequency_hz[k - 1]);
        TEST_ASSERT_TRUE(model.damping_ratio[k] > 0 && model.damping_ratio[k] < 1);
        TEST_ASSERT_TRUE(model.frequency_hz[k] < RIG_FS / 2);
    }
    TEST_ASSERT_EQUAL(RIG_MODES, consistent);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_order(identifier, RIG_NZ, &model)); // another order, nothing solved again
    expect_modes(1e-3, 0.1);
    free(v);
}

static void a_constant_channel_is_named(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 13);
    for (int n = 0; n < N; ++n) v[n * RIG_M] = 3.7;
    for (int detrend = 0; detrend < 2; ++detrend) {
        prepare(v, N, 0, (okid_detrend_t)detrend);
        TEST_ASSERT_EQUAL(OKID_ERR_INPUT, okid_identify_run(identifier, accumulator, &model));
        TEST_ASSERT_EQUAL(0, model.observer_info.channel);
    }
    free(v);
    v = rig_record(&rig, N, 0.01, NULL, 13);
    for (int n = 0; n < N; ++n) v[n * RIG_M + 3] = -1e6;
    prepare(v, N, 0, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_ERR_OUTPUT, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_EQUAL(3, model.observer_info.channel);
    free(v);
}

static void few_rows_are_refused_or_marked(void) {
    double* v = rig_record(&rig, 400, 0.01, NULL, 14);
    prepare(v, 60, 0, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_identify_run(identifier, accumulator, &model));
    prepare(v, 400, 0, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_TRUE(model.warnings & OKID_NOTE_FEW_ROWS);
    TEST_ASSERT_EQUAL(40, okid_identify_usable_p(1, 3, 40, 10000));
    TEST_ASSERT_EQUAL(9, okid_identify_usable_p(1, 3, 40, 400));
    TEST_ASSERT_EQUAL(1, okid_identify_usable_p(1, 3, 40, 5));
    free(v);
}

static okid_model_t view(void) {
    return (okid_model_t){RIG_NU, RIG_NY, model.n_z, model.A, model.B, model.C, model.D, model.K};
}

static void split_record(const double* v, okid_real_t* u, okid_real_t* y) {
    for (int n = 0; n < N; ++n) {
        u[n] = (okid_real_t)v[n * RIG_M];
        for (int o = 0; o < RIG_NY; ++o) y[n * RIG_NY + o] = (okid_real_t)v[n * RIG_M + 1 + o];
    }
}

static double misfit(const okid_real_t* a, const okid_real_t* b, int count) {
    double top = 0, bottom = 0;
    for (int i = 0; i < count; ++i) {
        top += (a[i] - b[i]) * (a[i] - b[i]);
        bottom += a[i] * a[i];
    }
    return sqrt(top / bottom);
}

// Trap 3: L of the paper is -K. With K the predictor follows the record to the noise; with L it runs away.
static void trap_03_kalman_gain_is_minus_L(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 15);
    okid_real_t *u = malloc(sizeof *u * N), *y = malloc(sizeof *y * N * RIG_NY), *yhat = malloc(sizeof *y * N * RIG_NY),
                K[RIG_NZ * RIG_NY];
    prepare(v, N, RIG_NZ, OKID_DETREND_NONE);
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_FALSE(model.warnings & OKID_NOTE_PREDICTOR_UNSTABLE);
    split_record(v, u, y);
    okid_model_t m = view();
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&m));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_predict(&m, u, y, N, NULL, yhat, work));
    const double with_k = misfit(y, yhat, N * RIG_NY);
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&m, u, N, NULL, yhat, work));
    const double simulated = misfit(y, yhat, N * RIG_NY);
    for (int i = 0; i < RIG_NZ * RIG_NY; ++i) K[i] = -model.K[i];
    m.K = K;
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_predict(&m, u, y, 500, NULL, yhat, work));
    const double with_l = misfit(y, yhat, 500 * RIG_NY);
    TEST_ASSERT_TRUE(with_k < 0.2 && simulated < 0.2);
    TEST_ASSERT_TRUE(with_l > 2 * with_k);
    free(v);
    free(u);
    free(y);
    free(yhat);
    free(work);
}

static void initial_state_is_recovered(void) {
    const double x0[RIG_NZ] = {20, -10, 5, 15, -25, 8};
    okid_real_t found[RIG_NZ], matrices[4][RIG_NZ * RIG_NZ];
    double* v = rig_record(&rig, N, 0.001, x0, 16);
    okid_real_t *u = malloc(sizeof *u * N), *y = malloc(sizeof *y * N * RIG_NY);
    split_record(v, u, y);
    y[100] = NAN; // a missing sample carries no weight
    const double* truth[4] = {rig.A, rig.B, rig.C, rig.D};
    const int sizes[4] = {RIG_NZ * RIG_NZ, RIG_NZ * RIG_NU, RIG_NY * RIG_NZ, RIG_NY * RIG_NU};
    for (int k = 0; k < 4; ++k)
        for (int i = 0; i < sizes[k]; ++i) matrices[k][i] = (okid_real_t)truth[k][i];
    const okid_model_t m = {RIG_NU, RIG_NY, RIG_NZ, matrices[0], matrices[1], matrices[2], matrices[3], NULL};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&m));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&m, u, y, N, found, work));
    for (int i = 0; i < RIG_NZ; ++i) TEST_ASSERT_DOUBLE_WITHIN(0.02, x0[i], found[i]);
    free(v);
    free(u);
    free(y);
    free(work);
}

// A mode that stands twice in a model: the normal equations of its state are singular, the ridge decides. What both copies
// give together is still what the record holds.
static void initial_state_of_a_repeated_mode(void) {
    enum { NZ = 4, COUNT = 400 };
    const double radius = 0.99, angle = 0.4, x0[2] = {3, -2};
    okid_real_t A[NZ * NZ] = {0}, C[NZ] = {1, 0.5, 1, 0.5}, B[NZ] = {0}, D[1] = {0}, u[COUNT] = {0}, y[COUNT],
                       found[NZ];
    for (int i = 0; i < NZ; ++i) {
        const int partner = i ^ 1;
        A[i * NZ + i] = (okid_real_t)(radius * cos(angle));
        A[partner * NZ + i] = (okid_real_t)((i % 2 ? -radius : radius) * sin(angle));
    }
    for (int n = 0; n < COUNT; ++n) {
        const double size = pow(radius, n), c = cos(angle * n), s = sin(angle * n);
        y[n] = (okid_real_t)(size * (c * x0[0] + s * x0[1] + 0.5 * (c * x0[1] - s * x0[0])));
    }
    const okid_model_t m = {1, 1, NZ, A, B, C, D, NULL};
    okid_real_t* work = malloc(sizeof *work * okid_model_workspace(&m));
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_initial_state(&m, u, y, COUNT, found, work));
    for (int i = 0; i < 2; ++i) TEST_ASSERT_DOUBLE_WITHIN(repeated_limit, x0[i], found[i] + found[i + 2]);
    free(work);
}

static void poles_that_are_no_modes_are_left_out(void) {
    // real, negative real, unstable pair, pair at Nyquist, one true pair
    enum { NZ = 8 };
    okid_real_t A[NZ * NZ] = {0}, C[NZ], f[4], z[4], mpc[4], re[4], im[4];
    const double pairs[3][2] = {{1.01, 0.5}, {0.99, 3.1405}, {0.98, 0.7}};
    A[0] = (okid_real_t)0.9;
    A[NZ + 1] = (okid_real_t)-0.8;
    for (int k = 0; k < 3; ++k) {
        const int i = 2 + 2 * k;
        A[i * NZ + i] = A[(i + 1) * NZ + i + 1] = (okid_real_t)(pairs[k][0] * cos(pairs[k][1]));
        A[i * NZ + i + 1] = (okid_real_t)(pairs[k][0] * sin(pairs[k][1]));
        A[(i + 1) * NZ + i] = -A[i * NZ + i + 1];
    }
    for (int i = 0; i < NZ; ++i) C[i] = 1;
    const okid_model_t given = {.n_u = 1, .n_y = 1, .n_z = NZ, .A = A, .C = C};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = z, .mpc = mpc, .shape_re = re, .shape_im = im};
    const size_t bytes = okid_modal_memsize(1, NZ);
    void* work = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&given, 0.01, &modes, work, bytes));
    TEST_ASSERT_EQUAL(1, modes.count);
    TEST_ASSERT_DOUBLE_WITHIN(pole_limit, 100 * hypot(log(0.98), 0.7) / 6.283185307179586, f[0]);
    TEST_ASSERT_DOUBLE_WITHIN(pole_limit, -log(0.98) / hypot(log(0.98), 0.7), z[0]);
    TEST_ASSERT_DOUBLE_WITHIN(unit_limit, 1.01, modes.radius);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_modal_analyse(&given, 0.01, &modes, work, 8));
    modes.shape_im = NULL;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_modal_analyse(&given, 0.01, &modes, work, bytes));
    const okid_real_t a[2] = {1, 1}, b[2] = {1, -1}, zero[2] = {0, 0};
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1, okid_modal_mac(2, a, zero, zero, a));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0, okid_modal_mac(2, a, zero, b, zero));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, okid_modal_mac(2, zero, zero, b, zero)); // a shape of nothing is like no other
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, okid_modal_mac(2, b, zero, zero, zero));
    free(work);
}

static void wrong_use_is_refused(void) {
    const okid_identify_config_t good = {RIG_NU, RIG_NY, P, 0, 0, 0, RIG_FS, OKID_METHOD_OKID_ERA, OKID_DETREND_MEAN};
    okid_identify_config_t bad = good;
    char small[32];
    okid_identify_t* s;
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_identify_create(&s, &good, small, sizeof small));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_identify_create(&s, NULL, small, sizeof small));
    bad.fs_hz = 0;
    TEST_ASSERT_EQUAL(0, okid_identify_memsize(&bad));
    bad = good;
    bad.n_u = -1;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_identify_create(&s, &bad, small, sizeof small));
    double* v = rig_record(&rig, N, 0.01, NULL, 1);
    prepare(v, N, 500, OKID_DETREND_MEAN); // an order beyond the Hankel matrix is reduced, and said
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_TRUE(model.warnings & OKID_NOTE_ORDER_REDUCED);
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_identify_order(identifier, 0, &model));
    free(v);
    for (int status = -12; status <= 3; ++status)
        TEST_ASSERT_NOT_EQUAL(0, strcmp("unknown status", okid_status_text((okid_status_t)status)));
    TEST_ASSERT_EQUAL_STRING("unknown status", okid_status_text((okid_status_t)-99));
    for (int bit = 0; bit < 8; ++bit) TEST_ASSERT_NOT_NULL(okid_warning_code(1u << bit));
    TEST_ASSERT_NULL(okid_warning_code(1u << 30));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(noise_free_modes_to_the_last_digits);
    RUN_TEST(noisy_modes_and_offsets);
    RUN_TEST(over_order_keeps_the_true_modes_and_marks_the_others);
    RUN_TEST(a_constant_channel_is_named);
    RUN_TEST(few_rows_are_refused_or_marked);
    RUN_TEST(trap_03_kalman_gain_is_minus_L);
    RUN_TEST(initial_state_is_recovered);
    RUN_TEST(initial_state_of_a_repeated_mode);
    RUN_TEST(poles_that_are_no_modes_are_left_out);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
