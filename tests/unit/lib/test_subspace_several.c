// SPDX-License-Identifier: MIT
// Subspace methods with several forces and sensors: what is asked for does not depend on what else is asked for, and
// output error gives B, D and every initial state back.
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

// Records of unequal lengths, each from a state of its own, with holes in outputs and in one input.
static void output_error_gives_inputs_and_initial_states_back(void) {
    enum { RECORDS = 3, ALL = 900 };
    static const int32_t counts[RECORDS] = {400, 300, 200};
    for (int which = 0; which < 2; ++which) {
        static okid_real_t A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * WIDE_MOST], C[WIDE_MOST * WIDE_NZ],
            D[WIDE_MOST * WIDE_MOST], x0[RECORDS * WIDE_NZ];
        double start[RECORDS * WIDE_NZ];
        wide_make(&rig, 2 + which, 3 - which);
        if (which == 1) { // a pair that becomes two real poles
            rig.A[2 * (WIDE_NZ + 1)] = 0.8, rig.A[3 * (WIDE_NZ + 1)] = -0.6;
            rig.A[2 * (WIDE_NZ + 1) + 1] = rig.A[3 * (WIDE_NZ + 1) - 1] = 0;
        }
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
    RUN_TEST(output_error_gives_inputs_and_initial_states_back);
    return UNITY_END();
}
