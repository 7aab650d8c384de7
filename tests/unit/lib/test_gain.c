// SPDX-License-Identifier: MIT
// The Kalman gain and the covariance of the innovations of every method, with and without inputs, against the
// innovations model that made the record; in units that differ.
#include "wide_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { NY = 3, N = 160000, BLOCKS = 8, ROWS = 12, PAST = 12 };
static const double units[NY] = {1, 4, 0.25};

static wide_t rig;
static double K[WIDE_NZ * NY], covariance[NY * NY];
static void* blocks[2];
static okid_identified_t model;

void setUp(void) {}
void tearDown(void) {
    for (int k = 0; k < 2; ++k) {
        free(blocks[k]);
        blocks[k] = NULL;
    }
}

/// A - K C forgets what is older than the rows; the outputs in their units, correlated innovations.
static double* make(int n_u) {
    double draws[NY * NY] = {0}, x[WIDE_NZ] = {0}, next[WIDE_NZ];
    uint64_t state = 9;
    wide_make(&rig, n_u, NY);
    const int m = n_u + NY;
    for (int i = 0; i < WIDE_NZ * WIDE_NZ; ++i) rig.A[i] *= 0.6;
    for (int i = 0; i < WIDE_NZ * NY; ++i) K[i] = 0.5 * rig_uniform(&state) - 0.2;
    for (int j = 0; j < WIDE_NZ; ++j)
        for (int i = 0; i < WIDE_NZ; ++i)
            for (int o = 0; o < NY; ++o) rig.A[j * WIDE_NZ + i] += K[o * WIDE_NZ + i] * rig.C[j * NY + o];
    for (int i = 0; i < NY; ++i)
        for (int o = i; o < NY; ++o) draws[i * NY + o] = o == i ? 1 + 0.5 * i : 0.8 * rig_uniform(&state);
    memset(covariance, 0, sizeof covariance);
    for (int a = 0; a < NY; ++a)
        for (int b = 0; b < NY; ++b)
            for (int i = 0; i < NY; ++i) covariance[b * NY + a] += draws[i * NY + a] * draws[i * NY + b];
    double* v = malloc(sizeof *v * (size_t)(N * m));
    for (int n = 0; n < N; ++n) {
        double *sample = v + (size_t)n * (size_t)m, white[NY], e[NY];
        for (int j = 0; j < n_u; ++j) sample[j] = rig_normal(&state);
        for (int o = 0; o < NY; ++o) white[o] = rig_normal(&state);
        for (int o = 0; o < NY; ++o) {
            e[o] = 0;
            for (int i = 0; i < NY; ++i) e[o] += draws[i * NY + o] * white[i];
            double y = e[o];
            for (int j = 0; j < n_u; ++j) y += rig.D[j * NY + o] * sample[j];
            for (int i = 0; i < WIDE_NZ; ++i) y += rig.C[i * NY + o] * x[i];
            sample[n_u + o] = units[o] * y;
        }
        for (int i = 0; i < WIDE_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < n_u; ++j) next[i] += rig.B[j * WIDE_NZ + i] * sample[j];
            for (int o = 0; o < NY; ++o) next[i] += K[o * WIDE_NZ + i] * e[o];
            for (int j = 0; j < WIDE_NZ; ++j) next[i] += rig.A[j * WIDE_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof x);
    }
    return v;
}

static void identify(const double* v, okid_method_t method, int n_u) {
    const okid_identify_config_t c = {
        .n_u = n_u, .n_y = NY, .p = PAST, .rows = ROWS, .order = WIDE_NZ, .fs_hz = WIDE_FS, .method = method};
    const okid_accumulator_config_t a = {
        .n_u = n_u, .n_y = NY, .lags = okid_identify_lags(&c), .forgetting = 1, .edges = 1};
    const size_t bytes[2] = {okid_accumulator_memsize(&a), okid_identify_memsize(&c)};
    okid_accumulator_t* accumulator = NULL;
    okid_identify_t* identifier = NULL;
    tearDown();
    for (int k = 0; k < 2; ++k) blocks[k] = malloc(bytes[k]);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, blocks[0], bytes[0]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, blocks[1], bytes[1]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(accumulator, v, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, accumulator, &model));
    TEST_ASSERT_FALSE(model.warnings & OKID_NOTE_PREDICTOR_UNSTABLE);
}

/// C A^k K for k = 0.., the units taken off, from the truth; a part in so many of the largest.
static double gain_error(void) {
    static double its[(BLOCKS + 1) * NY * NY], truth[(BLOCKS + 1) * NY * NY];
    static const okid_real_t none[NY * NY] = {0};
    wide_t gain = rig;
    gain.n_u = NY;
    memcpy(gain.B, K, sizeof K);
    memset(gain.D, 0, sizeof gain.D);
    wide_truth(&gain, BLOCKS, truth);
    wide_markov(NY, NY, WIDE_NZ, model.A, model.K, model.C, none, BLOCKS, its);
    double worst = 0, size = 0;
    for (int k = 0; k < (BLOCKS + 1) * NY * NY; ++k) {
        worst = fmax(worst, fabs(its[k] * units[k / NY % NY] / units[k % NY] - truth[k]));
        size = fmax(size, fabs(truth[k]));
    }
    return worst / size;
}

static double covariance_error(void) {
    double worst = 0;
    for (int k = 0; k < NY * NY; ++k)
        worst = fmax(worst, fabs((double)model.innovation[k] / (units[k / NY] * units[k % NY]) - covariance[k]));
    return worst / covariance[NY * NY - 1];
}

static void of_every_method(int n_u) {
    double* v = make(n_u);
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method) {
        identify(v, (okid_method_t)method, n_u);
        // okid with inputs finds it through the observability matrix, whose last states are weak
        const int by_markov = n_u > 0 && method <= OKID_METHOD_OKID_ERA_DC;
        TEST_ASSERT_TRUE(gain_error() < (by_markov ? 0.3 : 0.1));
        TEST_ASSERT_TRUE(covariance_error() < 0.01);
    }
    free(v);
}

static void with_inputs(void) { of_every_method(2); }
static void without_inputs(void) { of_every_method(0); }

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(with_inputs);
    RUN_TEST(without_inputs);
    return UNITY_END();
}
