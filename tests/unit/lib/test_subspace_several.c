// SPDX-License-Identifier: MIT
// Subspace methods with several forces and sensors: what is asked for does not depend on what else is asked for, the gain is
// that of the innovations model behind the record, output error gives B, D and every initial state back.
#include "wide_rig.h"

#include <okid/okid.h>
#include <okid/steps/subspace.h>
#include <unity.h>

enum { ROWS = 12, LAGS = 2 * ROWS - 1, M_MAX = 5, W_MAX = 2 * ROWS * M_MAX, TOP = 10 };

static const okid_subspace_method_t methods[] = {OKID_SUBSPACE_MOESP, OKID_SUBSPACE_CVA, OKID_SUBSPACE_SSARX};
static const char* const names[] = {"moesp", "cva", "ssarx"};

typedef struct found_t {
    okid_real_t A[TOP * TOP], B[TOP * WIDE_MOST], C[WIDE_MOST * TOP], D[WIDE_MOST * WIDE_MOST], K[TOP * WIDE_MOST],
        innovation[WIDE_MOST * WIDE_MOST];
} found_t;

static wide_t rig;
static double gram[W_MAX * W_MAX];
static long rows;
static void* block;

void setUp(void) {}
void tearDown(void) {
    free(block);
    block = NULL;
}

static void sums_of(const double* v, int count) {
    const okid_accumulator_config_t config = {.n_u = rig.n_u, .n_y = rig.n_y, .lags = LAGS, .forgetting = 1};
    const size_t bytes = okid_accumulator_memsize(&config);
    void* own = malloc(bytes);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, own, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, v, (size_t)count));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, gram, NULL));
    rows = (long)okid_accumulator_rows(a);
    free(own);
}

/// A new object that has decomposed the sums.
static okid_subspace_t* decomposed(okid_subspace_method_t method) {
    const okid_subspace_config_t config = {rig.n_u, rig.n_y, ROWS, method, TOP, 0, 0};
    const size_t bytes = okid_subspace_memsize(&config);
    okid_subspace_info_t info;
    okid_subspace_t* subspace = NULL;
    tearDown();
    block = malloc(bytes);
    memset(block, 0xff, bytes); // NaN, where something is read that was not written
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_create(&subspace, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram, rows, &info));
    return subspace;
}

static void what_is_asked_for_does_not_depend_on_the_rest(void) {
    for (int which = 0; which < 2; ++which) {
        static found_t whole, part;
        wide_make(&rig, 2 + which, 3 - which);
        double* v = wide_record(&rig, 4000, 0.3, 5);
        sums_of(v, 4000);
        for (int k = 0; k < 3; ++k) {
            const size_t a = sizeof *part.A * WIDE_NZ * WIDE_NZ, b = sizeof *part.B * (size_t)(WIDE_NZ * rig.n_u),
                         c = sizeof *part.C * (size_t)(WIDE_NZ * rig.n_y),
                         d = sizeof *part.D * (size_t)(rig.n_y * rig.n_u),
                         e = sizeof *part.innovation * (size_t)(rig.n_y * rig.n_y);
            TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(decomposed(methods[k]), WIDE_NZ, whole.A, whole.B, whole.C,
                                                             whole.D, whole.K, whole.innovation));
            for (int asked = 0; asked < 5; ++asked) {
                const int inputs = asked == 1, gain = asked == 2 || asked == 4, noise = asked == 3 || asked == 4;
                memset(&part, 0, sizeof part);
                TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(decomposed(methods[k]), WIDE_NZ, part.A,
                                                                 inputs ? part.B : NULL, part.C, inputs ? part.D : NULL,
                                                                 gain ? part.K : NULL, noise ? part.innovation : NULL));
                TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.A, part.A, a, names[k]);
                TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.C, part.C, c, names[k]);
                if (inputs) TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.B, part.B, b, names[k]);
                if (inputs) TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.D, part.D, d, names[k]);
                if (gain) TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.K, part.K, c, names[k]);
                if (noise) TEST_ASSERT_EQUAL_MEMORY_MESSAGE(whole.innovation, part.innovation, e, names[k]);
            }
        }
        free(v);
    }
}

/// x_(n+1) = A x + B u + K e, y = C x + D u + e with correlated e, `draws` of n_y x n_y.
static double* innovations_record(const double* K, const double* draws, int count) {
    const int n_u = rig.n_u, n_y = rig.n_y, m = n_u + n_y;
    double *v = malloc(sizeof *v * (size_t)(count * m)), x[WIDE_NZ] = {0}, next[WIDE_NZ];
    uint64_t state = 77;
    for (int n = 0; n < count; ++n) {
        double *sample = v + (size_t)n * (size_t)m, white[WIDE_MOST], e[WIDE_MOST];
        for (int j = 0; j < n_u; ++j) sample[j] = rig_normal(&state);
        for (int o = 0; o < n_y; ++o) white[o] = rig_normal(&state);
        for (int o = 0; o < n_y; ++o) {
            e[o] = 0;
            for (int i = 0; i < n_y; ++i) e[o] += draws[i * n_y + o] * white[i];
            sample[n_u + o] = e[o];
            for (int j = 0; j < n_u; ++j) sample[n_u + o] += rig.D[j * n_y + o] * sample[j];
            for (int i = 0; i < WIDE_NZ; ++i) sample[n_u + o] += rig.C[i * n_y + o] * x[i];
        }
        for (int i = 0; i < WIDE_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < n_u; ++j) next[i] += rig.B[j * WIDE_NZ + i] * sample[j];
            for (int o = 0; o < n_y; ++o) next[i] += K[o * WIDE_NZ + i] * e[o];
            for (int j = 0; j < WIDE_NZ; ++j) next[i] += rig.A[j * WIDE_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof x);
    }
    return v;
}

/// C A^k K for k = 0.., and the truth of it; a part in so many of the largest.
static double gain_error(const found_t* found, const double* K) {
    enum { BLOCKS = 8 };
    static double its[(BLOCKS + 1) * WIDE_MOST * WIDE_MOST], truth[(BLOCKS + 1) * WIDE_MOST * WIDE_MOST];
    static const okid_real_t none[WIDE_MOST * WIDE_MOST] = {0};
    wide_t gain = rig;
    gain.n_u = rig.n_y;
    memcpy(gain.B, K, sizeof *K * (size_t)(WIDE_NZ * rig.n_y));
    memset(gain.D, 0, sizeof gain.D);
    wide_truth(&gain, BLOCKS, truth);
    wide_markov(rig.n_y, rig.n_y, WIDE_NZ, found->A, found->K, found->C, none, BLOCKS, its);
    double worst = 0, size = 0;
    for (int k = 0; k < (BLOCKS + 1) * rig.n_y * rig.n_y; ++k) {
        worst = fmax(worst, fabs(its[k] - truth[k]));
        size = fmax(size, fabs(truth[k]));
    }
    return worst / size;
}

static void the_gain_is_that_of_the_innovations(void) {
    enum { N = 160000 };
    for (int which = 0; which < 2; ++which) {
        double K[WIDE_NZ * WIDE_MOST], draws[WIDE_MOST * WIDE_MOST] = {0}, covariance[WIDE_MOST * WIDE_MOST] = {0};
        uint64_t state = 9;
        wide_make(&rig, 2 + which, 3 - which);
        const int n_y = rig.n_y;
        for (int i = 0; i < WIDE_NZ * WIDE_NZ; ++i) rig.A[i] *= 0.6; // A - K C: forgets what is older than the rows
        for (int i = 0; i < WIDE_NZ * n_y; ++i) K[i] = 0.5 * rig_uniform(&state) - 0.2;
        for (int j = 0; j < WIDE_NZ; ++j)
            for (int i = 0; i < WIDE_NZ; ++i)
                for (int o = 0; o < n_y; ++o) rig.A[j * WIDE_NZ + i] += K[o * WIDE_NZ + i] * rig.C[j * n_y + o];
        for (int i = 0; i < n_y; ++i)
            for (int o = i; o < n_y; ++o) draws[i * n_y + o] = o == i ? 1 + 0.5 * i : 0.8 * rig_uniform(&state);
        for (int a = 0; a < n_y; ++a)
            for (int b = 0; b < n_y; ++b)
                for (int i = 0; i < n_y; ++i) covariance[b * n_y + a] += draws[i * n_y + a] * draws[i * n_y + b];
        double* v = innovations_record(K, draws, N);
        sums_of(v, N);
        free(v);
        for (int k = 0; k < 3; ++k) {
            static found_t found;
            TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_realize(decomposed(methods[k]), WIDE_NZ, found.A, found.B, found.C,
                                                             found.D, found.K, found.innovation));
            const double largest = covariance[n_y * n_y - 1];
            for (int i = 0; i < n_y * n_y; ++i)
                TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.1 * largest, covariance[i], (double)found.innovation[i], names[k]);
            TEST_ASSERT_TRUE_MESSAGE(gain_error(&found, K) < 0.08, names[k]);
        }
    }
}

// Records of unequal lengths, each from a state of its own, with holes in outputs and in one input.
static void output_error_gives_inputs_and_initial_states_back(void) {
    enum { RECORDS = 3, ALL = 900 };
    static const int32_t counts[RECORDS] = {400, 300, 200};
    for (int which = 0; which < 2; ++which) {
        static okid_real_t A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * WIDE_MOST], C[WIDE_MOST * WIDE_NZ],
            D[WIDE_MOST * WIDE_MOST], x0[RECORDS * WIDE_NZ];
        double start[RECORDS * WIDE_NZ];
        wide_make(&rig, 2 + which, 3 - which);
        const int n_u = rig.n_u, n_y = rig.n_y, m = n_u + n_y;
        double *v = malloc(sizeof *v * (size_t)(ALL * m)), *to = v;
        for (int r = 0; r < RECORDS; ++r) { // what a state rings down to is added to the answer from rest
            double* part = wide_record(&rig, counts[r], 0, 30 + (uint64_t)r);
            double x[WIDE_NZ], next[WIDE_NZ];
            for (int i = 0; i < WIDE_NZ; ++i) x[i] = start[r * WIDE_NZ + i] = 3 * sin(1 + i + 2 * r);
            for (int n = 0; n < counts[r]; ++n) {
                for (int o = 0; o < n_y; ++o)
                    for (int i = 0; i < WIDE_NZ; ++i) part[n * m + n_u + o] += rig.C[i * n_y + o] * x[i];
                for (int i = 0; i < WIDE_NZ; ++i) {
                    next[i] = 0;
                    for (int j = 0; j < WIDE_NZ; ++j) next[i] += rig.A[j * WIDE_NZ + i] * x[j];
                }
                memcpy(x, next, sizeof x);
            }
            memcpy(to, part, sizeof *part * (size_t)(counts[r] * m));
            to += counts[r] * m;
            free(part);
        }
        v[3 * m + n_u] = NAN;
        v[50 * m + m - 1] = INFINITY;
        v[250 * m + 1] = v[251 * m + 1] = NAN;
        for (int i = 0; i < WIDE_NZ * WIDE_NZ; ++i) A[i] = (okid_real_t)rig.A[i];
        for (int i = 0; i < n_y * WIDE_NZ; ++i) C[i] = (okid_real_t)rig.C[i];
        const okid_model_t model = {.n_u = n_u, .n_y = n_y, .n_z = WIDE_NZ, .A = A, .C = C};
        const okid_records_t records = {RECORDS, counts, v};
        const size_t bytes = okid_subspace_output_error_memsize(n_u, n_y, WIDE_NZ, RECORDS);
        void* work = malloc(bytes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_output_error(&model, &records, B, D, x0, work, bytes));
        for (int i = 0; i < WIDE_NZ * n_u; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-9, rig.B[i], (double)B[i]);
        for (int i = 0; i < n_y * n_u; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-9, rig.D[i], (double)D[i]);
        for (int i = 0; i < RECORDS * WIDE_NZ; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-8, start[i], (double)x0[i]);
        free(work);
        free(v);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(what_is_asked_for_does_not_depend_on_the_rest);
    RUN_TEST(the_gain_is_that_of_the_innovations);
    RUN_TEST(output_error_gives_inputs_and_initial_states_back);
    return UNITY_END();
}
