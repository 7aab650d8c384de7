// SPDX-License-Identifier: MIT
// Subspace identification: MOESP, CVA and SSARX from the Gram matrix and from the triangular factor, output error.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>
#include <unity.h>

enum { I = 10, LAGS = 2 * I - 1, W = 2 * I * RIG_M, N = 4000, TOP = 12, LAST = 40 };

// Relative, some 4 to 10 times the worst measured over methods, forms of input and backends. Noise-free: frequencies, damping
// ratios, Markov parameters of the live B and D and by output error, initial states; singular values of both forms of input.
static const double f_limit = TOLERANCE(1e-13, 4e-6), zeta_limit = TOLERANCE(4e-11, 6e-4),
                    markov_limit = TOLERANCE(4e-12, 2e-5), x0_limit = TOLERANCE(2e-12, 3e-5),
                    same_limit = TOLERANCE(1e-12, 1e-5);

static rig_t rig;
static double gram[W * W];
static okid_real_t factor[W * W];
static okid_real_t A[TOP * TOP], B[TOP * RIG_NU], C[RIG_NY * TOP], D[RIG_NY * RIG_NU], K[TOP * RIG_NY];
static okid_real_t innovation[RIG_NY * RIG_NY];
static okid_subspace_info_t info;
static okid_subspace_t* subspace;
static void* block;

static const okid_subspace_method_t methods[] = {OKID_SUBSPACE_MOESP, OKID_SUBSPACE_CVA, OKID_SUBSPACE_SSARX};
static const char* const names[] = {"moesp", "cva", "ssarx"};

void setUp(void) { rig_make(&rig); }
void tearDown(void) {
    free(block);
    block = NULL;
}

static okid_subspace_config_t config_of(okid_subspace_method_t method) {
    const okid_subspace_config_t config = {RIG_NU, RIG_NY, I, method, TOP, 1, 0};
    return config;
}

static void create(const okid_subspace_config_t* config) {
    const size_t bytes = okid_subspace_memsize(config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_create(&subspace, config, block, bytes));
}

/// Gram matrix and factor of a record.
static long sums_of(const double* v, int count, int n_u, int n_y) {
    const okid_accumulator_config_t config = {.n_u = n_u, .n_y = n_y, .lags = LAGS, .forgetting = 1};
    const okid_square_root_config_t root = {.n_u = n_u, .n_y = n_y, .lags = LAGS, .forgetting = 1};
    const size_t bytes = okid_accumulator_memsize(&config), more = okid_square_root_memsize(&root);
    void *one = malloc(bytes), *two = malloc(more);
    okid_accumulator_t* a = NULL;
    okid_square_root_t* r = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, one, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, v, (size_t)count));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, gram, NULL));
    const long rows = (long)okid_accumulator_rows(a);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&r, &root, two, more));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r, v, (size_t)count));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(r, OKID_DETREND_NONE, factor, NULL));
    TEST_ASSERT_EQUAL(rows, okid_square_root_rows(r));
    free(one);
    free(two);
    return rows;
}

static void realize(int order) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(subspace, order, A, B, C, D, K, innovation));
}

static void modes_of(int order, const okid_real_t* a, double dt, okid_modes_t* modes) {
    const okid_model_t model = {.n_u = RIG_NU, .n_y = RIG_NY, .n_z = order, .A = a, .C = C};
    const size_t bytes = okid_modal_memsize(RIG_NY, order);
    void* work = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, dt, modes, work, bytes));
    free(work);
}

/// Worst relative error of frequency and damping ratio; radius of A.
static void mode_errors(int order, double* f_error, double* zeta_error, double* radius) {
    okid_real_t f[TOP], zeta[TOP];
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta};
    modes_of(order, A, 1 / RIG_FS, &modes);
    if (radius) *radius = modes.radius;
    *f_error = *zeta_error = 0;
    for (int k = 0; k < RIG_MODES; ++k) {
        int best = 0;
        for (int j = 0; j < modes.count; ++j)
            if (fabs(f[j] - rig_frequency[k]) < fabs(f[best] - rig_frequency[k])) best = j;
        *f_error = fmax(*f_error, fabs(f[best] / rig_frequency[k] - 1));
        *zeta_error = fmax(*zeta_error, fabs(zeta[best] / rig_damping[k] - 1));
    }
}

/// Of D, C B, C A B, .. relative to the largest.
static double markov_error(int order) {
    double worst = 0, size = 0, x[TOP], next[TOP];
    for (int i = 0; i < order; ++i) x[i] = B[i];
    for (int k = 0; k <= LAST; ++k) {
        double expected[RIG_NY];
        rig_markov(&rig, k, expected);
        for (int o = 0; o < RIG_NY; ++o) {
            double y = k == 0 ? D[o] : 0;
            for (int i = 0; k > 0 && i < order; ++i) y += C[i * RIG_NY + o] * x[i];
            worst = fmax(worst, fabs(expected[o] - y));
            size = fmax(size, fabs(expected[o]));
        }
        for (int i = 0; k > 0 && i < order; ++i) {
            next[i] = 0;
            for (int j = 0; j < order; ++j) next[i] += A[j * order + i] * x[j];
        }
        if (k > 0) memcpy(x, next, sizeof x);
    }
    return worst / size;
}

/// Spectral radius of A - K C.
static double predictor_radius(int order) {
    okid_real_t closed[TOP * TOP];
    for (int j = 0; j < order; ++j)
        for (int i = 0; i < order; ++i) {
            closed[j * order + i] = A[j * order + i];
            for (int o = 0; o < RIG_NY; ++o) closed[j * order + i] -= K[o * order + i] * C[j * RIG_NY + o];
        }
    okid_modes_t modes = {0};
    modes_of(order, closed, 1, &modes);
    return modes.radius;
}

// Without noise every covariance is singular: the Gram matrix (trap 5), that of the future outputs (trap 7), the past of
// SSARX. Both forms of input give the system all the same.
static void noise_free_from_gram_and_factor(void) {
    double* v = rig_record(&rig, N, 0, NULL, 3);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    for (int k = 0; k < 3; ++k)
        for (int form = 0; form < 2; ++form) {
            const okid_subspace_config_t config = config_of(methods[k]);
            create(&config);
            TEST_ASSERT_EQUAL_MESSAGE(OKID_OK,
                                      form == 0 ? okid_subspace_decompose(subspace, gram, rows, &info)
                                                : okid_subspace_decompose_factor(subspace, factor, rows, &info),
                                      names[k]);
            int32_t count = 0;
            const okid_real_t* s = okid_subspace_singular_values(subspace, &count);
            TEST_ASSERT_EQUAL(I * RIG_NY, count);
            TEST_ASSERT_TRUE_MESSAGE(s[RIG_NZ] < 0.1 * s[RIG_NZ - 1], names[k]);
            realize(RIG_NZ);
            double f = 0, zeta = 0, radius = 0;
            mode_errors(RIG_NZ, &f, &zeta, &radius);
            TEST_ASSERT_TRUE_MESSAGE(f < f_limit, names[k]);
            TEST_ASSERT_TRUE_MESSAGE(zeta < zeta_limit, names[k]);
            TEST_ASSERT_TRUE_MESSAGE(markov_error(RIG_NZ) < markov_limit, names[k]);
            TEST_ASSERT_TRUE_MESSAGE(predictor_radius(RIG_NZ) < 1, names[k]);
        }
    free(v);
}

static void noise_and_the_gain(void) {
    double* v = rig_record(&rig, 20000, 0.05, NULL, 8);
    const long rows = sums_of(v, 20000, RIG_NU, RIG_NY);
    for (int k = 0; k < 3; ++k) {
        const okid_subspace_config_t config = config_of(methods[k]);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
        realize(RIG_NZ);
        double f = 0, zeta = 0, radius = 0;
        mode_errors(RIG_NZ, &f, &zeta, &radius);
        TEST_ASSERT_TRUE_MESSAGE(f < 1e-4 && zeta < 0.02 && radius < 1, names[k]);
        TEST_ASSERT_TRUE_MESSAGE(markov_error(RIG_NZ) < 0.01, names[k]);
        TEST_ASSERT_TRUE_MESSAGE(predictor_radius(RIG_NZ) < 1, names[k]);
        for (int o = 0; o < RIG_NY; ++o) { // the sensor noise and what ten samples leave unknown of the state
            TEST_ASSERT_TRUE_MESSAGE(innovation[o * RIG_NY + o] > 0.95 * 0.15 * 0.15, names[k]);
            TEST_ASSERT_TRUE_MESSAGE(innovation[o * RIG_NY + o] < 2.5 * 0.15 * 0.15, names[k]);
        }
    }
    free(v);
}

// One decomposition serves all orders: going elsewhere in between changes no bit, leaving outputs out changes none.
static void decompose_once_realize_many(void) {
    double* v = rig_record(&rig, N, 0.02, NULL, 5);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    for (int k = 0; k < 3; ++k) {
        okid_real_t before[TOP * TOP], gain[TOP * RIG_NY], alone[TOP * TOP];
        const okid_subspace_config_t config = config_of(methods[k]);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
        realize(RIG_NZ);
        memcpy(before, A, sizeof before);
        memcpy(gain, K, sizeof gain);
        for (int order = 1; order <= TOP; ++order) realize(order);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(subspace, RIG_NZ, alone, NULL, C, NULL, NULL, NULL));
        TEST_ASSERT_EQUAL_MEMORY(before, alone, sizeof *before * RIG_NZ * RIG_NZ);
        realize(RIG_NZ);
        TEST_ASSERT_EQUAL_MEMORY(before, A, sizeof *before * RIG_NZ * RIG_NZ);
        TEST_ASSERT_EQUAL_MEMORY(gain, K, sizeof *gain * RIG_NZ * RIG_NY);
    }
    free(v);
}

// True modes go on through the observability matrix as their eigenvalues say, modes of the noise do not.
static void emac_tells_modes_from_noise(void) {
    double* v = rig_record(&rig, 20000, 0.05, NULL, 6);
    const long rows = sums_of(v, 20000, RIG_NU, RIG_NY);
    for (int k = 0; k < 3; ++k) {
        const okid_subspace_config_t config = config_of(methods[k]);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
        realize(TOP);
        okid_real_t f[TOP], emac[TOP], mu_re[TOP], mu_im[TOP], psi_re[TOP * TOP], psi_im[TOP * TOP];
        okid_modes_t modes = {.frequency_hz = f, .mu_re = mu_re, .mu_im = mu_im, .psi_re = psi_re, .psi_im = psi_im};
        modes_of(TOP, A, 1 / RIG_FS, &modes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_emac(subspace, TOP, C, &modes, emac));
        TEST_ASSERT_TRUE(modes.count > RIG_MODES);
        for (int j = 0; j < modes.count; ++j) {
            int real = 0;
            for (int mode = 0; mode < RIG_MODES; ++mode) real |= fabs(f[j] / rig_frequency[mode] - 1) < 0.01;
            TEST_ASSERT_TRUE_MESSAGE(emac[j] >= 0 && emac[j] <= 1, names[k]);
            TEST_ASSERT_TRUE_MESSAGE(real ? emac[j] > 0.9 : emac[j] < 0.9, names[k]);
        }
    }
    free(v);
}

static void output_only_records_give_modes(void) {
    double* v = rig_record(&rig, 40000, 0.02, NULL, 4);
    for (int n = 0; n < 40000; ++n) memmove(v + n * RIG_NY, v + n * RIG_M + 1, sizeof *v * RIG_NY);
    const long rows = sums_of(v, 40000, 0, RIG_NY);
    for (int k = 0; k < 3; ++k) {
        okid_subspace_config_t config = config_of(methods[k]);
        config.n_u = 0;
        create(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(subspace, RIG_NZ, A, NULL, C, NULL, K, innovation));
        double f = 0, zeta = 0, radius = 0;
        mode_errors(RIG_NZ, &f, &zeta, &radius);
        TEST_ASSERT_TRUE_MESSAGE(f < 5e-3 && zeta < 0.3 && radius < 1, names[k]);
        TEST_ASSERT_TRUE_MESSAGE(predictor_radius(RIG_NZ) < 1, names[k]);
    }
    free(v);
}

static okid_status_t output_error(int order, int records, const int32_t* counts, const double* v, okid_real_t* x0) {
    const size_t bytes = okid_subspace_output_error_memsize(RIG_NU, RIG_NY, order, records);
    void* work = malloc(bytes);
    const okid_model_t model = {.n_u = RIG_NU, .n_y = RIG_NY, .n_z = order, .A = A, .C = C};
    const okid_records_t given = {records, counts, v};
    const okid_status_t status = okid_subspace_output_error(&model, &given, B, D, x0, work, bytes);
    free(work);
    return status;
}

// Three records, each from a state of its own, with holes in outputs and in the input: B, D and every initial state come
// back. The truth's own A and C are given.
static void output_error_finds_inputs_and_initial_states(void) {
    static const int32_t counts[3] = {700, 64, 500};
    double *v = malloc(sizeof *v * 1264 * RIG_M), *to = v, start[3][RIG_NZ];
    for (int r = 0; r < 3; ++r) {
        for (int i = 0; i < RIG_NZ; ++i) start[r][i] = 3 * sin(1 + i + 2 * r);
        double* part = rig_record(&rig, counts[r], 0, start[r], 20 + (uint64_t)r);
        memcpy(to, part, sizeof *part * (size_t)(counts[r] * RIG_M));
        to += counts[r] * RIG_M;
        free(part);
    }
    v[3 * RIG_M + 2] = NAN;                // an output
    v[100 * RIG_M + 1] = INFINITY;         // an output
    v[300 * RIG_M] = v[301 * RIG_M] = NAN; // the input: the state is lost
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) A[i] = (okid_real_t)rig.A[i];
    for (int i = 0; i < RIG_NY * RIG_NZ; ++i) C[i] = (okid_real_t)rig.C[i];
    okid_real_t x0[3 * RIG_NZ];
    TEST_ASSERT_EQUAL(OKID_OK, output_error(RIG_NZ, 3, counts, v, x0));
    TEST_ASSERT_TRUE(markov_error(RIG_NZ) < markov_limit);
    for (int r = 0; r < 3; ++r)
        for (int i = 0; i < RIG_NZ; ++i) TEST_ASSERT_DOUBLE_WITHIN(3 * x0_limit, start[r][i], x0[r * RIG_NZ + i]);
    free(v);
}

static void output_error_of_an_identified_model(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 12);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    const okid_subspace_config_t config = config_of(OKID_SUBSPACE_MOESP);
    create(&config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
    realize(RIG_NZ);
    const int32_t count = N, few = 4;
    TEST_ASSERT_EQUAL(OKID_OK, output_error(RIG_NZ, 1, &count, v, NULL));
    TEST_ASSERT_TRUE(markov_error(RIG_NZ) < 0.02);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, output_error(RIG_NZ, 1, &few, v, NULL));
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) A[i] *= 2; // far outside the unit circle
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, output_error(RIG_NZ, 1, &count, v, NULL));
    free(v);
}

// A ridge given by the caller is used as it is, in both forms: the same model.
static void the_ridge_of_the_caller(void) {
    double* v = rig_record(&rig, N, 0.02, NULL, 9);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    okid_real_t from_gram[TOP * TOP];
    okid_subspace_config_t config = config_of(OKID_SUBSPACE_MOESP);
    config.ridge = 1e-3;
    create(&config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
    TEST_ASSERT_EQUAL_DOUBLE(1e-3, info.ridge);
    int32_t count = 0;
    for (int k = 0; k < RIG_NZ; ++k) from_gram[k] = okid_subspace_singular_values(subspace, &count)[k];
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose_factor(subspace, factor, rows, &info));
    for (int k = 0; k < RIG_NZ; ++k)
        TEST_ASSERT_DOUBLE_WITHIN(same_limit * from_gram[k], from_gram[k],
                                  okid_subspace_singular_values(subspace, &count)[k]);
    free(v);
}

static void channels_at_fault_are_named(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    const int dead[] = {2, 0};
    for (int d = 0; d < 2; ++d) {
        for (int n = 0; n < N; ++n) v[n * RIG_M + dead[d]] = 0;
        const long rows = sums_of(v, N, RIG_NU, RIG_NY);
        for (int k = 0; k < 3; ++k) {
            const okid_subspace_config_t config = config_of(methods[k]);
            create(&config);
            const okid_status_t expected = d == 0 ? OKID_ERR_OUTPUT : OKID_ERR_INPUT;
            info.channel = -2;
            TEST_ASSERT_EQUAL(expected, okid_subspace_decompose(subspace, gram, rows, &info));
            if (d == 0) TEST_ASSERT_EQUAL(2, info.channel);
            if (d == 1) TEST_ASSERT_EQUAL(0, info.channel);
            info.channel = -2;
            TEST_ASSERT_EQUAL(expected, okid_subspace_decompose_factor(subspace, factor, rows, &info));
            TEST_ASSERT_EQUAL(dead[d], info.channel);
        }
        if (d == 0) // alive again
            for (int n = 0; n < N; ++n) v[n * RIG_M + 2] = v[n * RIG_M + 1] * v[n * RIG_M + 3];
    }
    free(v);
}

static void one_sine_does_not_excite(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    for (int n = 0; n < N; ++n) v[n * RIG_M] = sin(0.3 * n);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    for (int k = 0; k < 3; ++k) {
        const okid_subspace_config_t config = config_of(methods[k]);
        create(&config);
        TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, okid_subspace_decompose(subspace, gram, rows, &info));
        TEST_ASSERT_EQUAL(0, info.channel);
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_realize(subspace, 2, A, B, C, D, NULL, NULL));
    }
    free(v);
}

static void wrong_use_is_refused(void) {
    okid_subspace_config_t config = config_of(OKID_SUBSPACE_CVA);
    char small[16];
    const size_t needed = okid_subspace_memsize(&config);
    TEST_ASSERT_EQUAL(TOP, okid_subspace_max_order(&config));
    TEST_ASSERT_EQUAL(0, okid_subspace_max_order(NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_subspace_create(&subspace, &config, small, needed - 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_create(&subspace, NULL, small, needed));
    config.max_order = 0;
    TEST_ASSERT_EQUAL((I - 1) * RIG_NY, okid_subspace_max_order(&config));
    okid_subspace_config_t bad[] = {config, config, config, config, config, config, config};
    bad[0].n_y = 0;
    bad[1].rows = 1;
    bad[2].max_order = -1;
    bad[3].n_u = -1;
    bad[4].rows = 20000;
    bad[5].method = 7;
    bad[6].ridge = NAN;
    for (int k = 0; k < 7; ++k) {
        TEST_ASSERT_EQUAL(0, okid_subspace_memsize(&bad[k]));
        TEST_ASSERT_EQUAL(0, okid_subspace_max_order(&bad[k]));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_create(&subspace, &bad[k], small, sizeof small));
    }
    config = config_of(OKID_SUBSPACE_CVA);
    config.factor = 0;
    create(&config);
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_realize(subspace, 2, A, B, C, D, K, NULL)); // nothing decomposed
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_decompose(subspace, NULL, 1000, &info));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_subspace_decompose(subspace, gram, W - 1, &info));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_subspace_decompose_factor(subspace, factor, 4000, &info));
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    const long rows = sums_of(v, N, RIG_NU, RIG_NY);
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_realize(subspace, TOP + 1, A, B, C, D, K, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_realize(subspace, 0, A, B, C, D, K, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_realize(subspace, 2, A, B, C, NULL, K, NULL));
    okid_modes_t modes = {.count = 1};
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_emac(subspace, 2, C, &modes, A));
    modes.mu_re = modes.mu_im = modes.psi_re = modes.psi_im = A;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_emac(subspace, 0, C, &modes, A));
    const int32_t count = N, negative = -1;
    const okid_model_t model = {.n_u = 1, .n_y = 3, .n_z = 6, .A = A, .C = C};
    const okid_records_t one = {1, &count, v}, wrong = {1, &negative, v};
    TEST_ASSERT_EQUAL(0, okid_subspace_output_error_memsize(-1, 3, 6, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_subspace_output_error(&model, &one, NULL, D, NULL, small, 16));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_subspace_output_error(&model, &one, B, D, NULL, small, 16));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_subspace_output_error(&model, &wrong, B, D, NULL, small, 16));
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(noise_free_from_gram_and_factor);
    RUN_TEST(noise_and_the_gain);
    RUN_TEST(decompose_once_realize_many);
    RUN_TEST(emac_tells_modes_from_noise);
    RUN_TEST(output_only_records_give_modes);
    RUN_TEST(output_error_finds_inputs_and_initial_states);
    RUN_TEST(output_error_of_an_identified_model);
    RUN_TEST(the_ridge_of_the_caller);
    RUN_TEST(channels_at_fault_are_named);
    RUN_TEST(one_sine_does_not_excite);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
