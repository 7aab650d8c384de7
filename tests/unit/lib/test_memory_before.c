// SPDX-License-Identifier: MIT
// What a block held before means nothing: every object gives the same bits in memory of zeros, of huge numbers and of
// NaN.
#include "wide_rig.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { N = 1500, P = 8, ROWS = 10, BLOCKS = 6, MOST = 64 };
static const int fills[] = {0x00, 0x7f, 0xff}; // 0, 1.4e306, NaN

static wide_t rig;
static double *record, *outputs;
static void* blocks[MOST];
static int fill, count;
static uint64_t digest;

void setUp(void) {
    wide_make(&rig, 2, 3);
    record = wide_record(&rig, N, 0.3, 5);
    outputs = malloc(sizeof *outputs * N * 3);
    for (int n = 0; n < N; ++n) memcpy(outputs + n * 3, record + n * 5 + 2, sizeof *outputs * 3);
}

static void release(void) {
    while (count > 0) free(blocks[--count]);
}

void tearDown(void) {
    release();
    free(record);
    free(outputs);
}

static void* filled(size_t bytes) {
    TEST_ASSERT_GREATER_THAN(0, bytes);
    TEST_ASSERT_LESS_THAN(MOST, count);
    void* block = malloc(bytes);
    memset(block, fill, bytes);
    blocks[count++] = block;
    return block;
}

static void take(const void* from, size_t bytes) {
    for (size_t k = 0; k < bytes; ++k) digest = (digest ^ ((const unsigned char*)from)[k]) * 1099511628211ULL;
}
static void numbers(const okid_real_t* from, int many) { take(from, sizeof *from * (size_t)many); }

/// The same digest with each fill.
static void gives_the_same(void (*work)(int), int kind) {
    uint64_t first = 0;
    for (int k = 0; k < 3; ++k) {
        fill = fills[k];
        digest = 14695981039346656037ULL;
        work(kind);
        release();
        if (k == 0) first = digest;
        TEST_ASSERT_TRUE(digest == first);
    }
}

static okid_accumulator_t* summed(int n_u, int lags, int first, int last) {
    const okid_accumulator_config_t a = {.n_u = n_u, .n_y = 3, .lags = lags, .forgetting = 1, .edges = 1};
    const size_t bytes = okid_accumulator_memsize(&a);
    okid_accumulator_t* sums = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&sums, &a, filled(bytes), bytes));
    const double* from = n_u > 0 ? record + first * 5 : outputs + first * 3;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(sums, from, (size_t)(last - first)));
    return sums;
}

static void take_model(const okid_identified_t* m) {
    numbers(m->A, m->n_z * m->n_z);
    numbers(m->B, m->n_z * m->n_u);
    numbers(m->C, m->n_y * m->n_z);
    numbers(m->D, m->n_y * m->n_u);
    numbers(m->K, m->n_z * m->n_y);
    numbers(m->innovation, m->n_y * m->n_y);
    numbers(m->markov, m->markov_count * m->n_y * m->n_u);
    numbers(m->singular_values, m->singular_count);
    numbers(m->frequency_hz, m->mode_count);
    numbers(m->damping_ratio, m->mode_count);
    numbers(m->mpc, m->mode_count);
    numbers(m->emac, m->mode_count);
    numbers(m->shape_re, m->mode_count * m->n_y);
    numbers(m->shape_im, m->mode_count * m->n_y);
    take(&m->noise_level, sizeof m->noise_level);
    take(&m->observer_info, sizeof m->observer_info);
    take(&m->model_radius, sizeof m->model_radius);
    take(&m->warnings, sizeof m->warnings);
}

static okid_identify_config_t config_of(int kind) { // methods; + 8: no inputs; + 16 and 32: hankel; + 64: structured
    const int method = kind % 8, n_u = kind & 8 ? 0 : 2;
    return (okid_identify_config_t){.n_u = n_u,
                                    .n_y = 3,
                                    .p = method < OKID_METHOD_N4SID_MOESP && n_u > 0 ? P : 0,
                                    .rows = ROWS,
                                    .fs_hz = WIDE_FS,
                                    .method = (okid_method_t)method,
                                    .detrend = OKID_DETREND_MEAN,
                                    .hankel = (okid_hankel_t)(kind / 16 % 4),
                                    .solver = (okid_solver_t)(kind / 64)};
}

static void identification(int kind) {
    const okid_identify_config_t c = config_of(kind);
    const int lags = okid_identify_lags(&c);
    const size_t bytes = okid_identify_memsize(&c);
    okid_identify_t* identifier = NULL;
    okid_identified_t model;
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, filled(bytes), bytes));
    okid_accumulator_t* sums = summed(c.n_u, lags, 0, N);
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, sums, &model)); // of automatic order
    take_model(&model);
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_order(identifier, WIDE_NZ + 2, &model));
    take_model(&model);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_decompose(identifier, sums, &model));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_poles(identifier, WIDE_NZ, &model));
    numbers(model.frequency_hz, model.mode_count);
    numbers(model.emac, model.mode_count);
    if (c.n_u == 0 || c.solver == OKID_SOLVER_STRUCTURED) return;
    const okid_square_root_config_t q = {.n_u = c.n_u, .n_y = 3, .lags = lags, .forgetting = 1};
    const size_t more = okid_square_root_memsize(&q);
    okid_square_root_t* factor = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&factor, &q, filled(more), more));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(factor, record, N));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run_factor(identifier, factor, &model));
    take_model(&model);
}

static void of_an_identification(void) {
    for (int kind = 0; kind < 5; ++kind) gives_the_same(identification, kind);
    for (int kind = 8; kind < 13; ++kind) gives_the_same(identification, kind);
    for (int method = 0; method < 2; ++method) {
        gives_the_same(identification, method + 16);
        gives_the_same(identification, method + 32);
        gives_the_same(identification, method + 64);
        gives_the_same(identification, method + 64 + 16);
    }
}

/// Replicates without a block each, by a model of the rest or by the derivative.
static void deviation(int kind) {
    okid_identify_config_t c = config_of(kind % 16);
    c.order = c.max_order = WIDE_NZ;
    const int lags = okid_identify_lags(&c);
    okid_accumulator_t* whole = summed(c.n_u, lags, 0, N);
    okid_accumulator_config_t shape;
    okid_accumulator_config(whole, &shape);
    okid_jackknife_config_t j = okid_jackknife_defaults(&c, &shape);
    j.linear = kind >= 16;
    const size_t bytes = okid_identify_memsize(&c), more = okid_jackknife_memsize(&j);
    okid_identify_t* identifier = NULL;
    okid_jackknife_t* jackknife = NULL;
    okid_identified_t full;
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, &c, filled(bytes), bytes));
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_identify_run(identifier, whole, &full));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&jackknife, &j, filled(more), more));
    TEST_ASSERT_EQUAL(OKID_OK, j.linear ? okid_jackknife_begin_linear(jackknife, identifier, whole, &full)
                                        : okid_jackknife_begin(jackknife, whole, &full));
    const okid_replicates_config_t r = okid_replicates_defaults(c.n_u, 3, WIDE_NZ);
    const size_t room = okid_replicates_memsize(&r);
    okid_replicates_t* replicates = NULL;
    const okid_model_t its = {c.n_u, 3, full.n_z, full.A, full.B, full.C, full.D, NULL};
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&replicates, &r, filled(room), room));
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(replicates, &its, 1 / WIDE_FS));
    for (int b = 0; b < BLOCKS; ++b) {
        okid_accumulator_t* part = summed(c.n_u, lags, b * (N - lags) / BLOCKS, lags + (b + 1) * (N - lags) / BLOCKS);
        okid_model_t model;
        double share = 0;
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_jackknife_delete(jackknife, part, 1, &model, &share));
        numbers(model.A, WIDE_NZ * WIDE_NZ);
        numbers(model.B, WIDE_NZ * c.n_u);
        numbers(model.C, WIDE_NZ * 3);
        take(&share, sizeof share);
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_replicates_add(replicates, &model, share));
    }
    okid_uncertainty_t out;
    TEST_ASSERT_GREATER_OR_EQUAL(0, okid_replicates_finish(replicates, &out));
    numbers(out.frequency_std_hz, out.mode_count);
    numbers(out.damping_ratio_std, out.mode_count);
    numbers(out.shape_re_std, out.mode_count * 3);
    numbers(out.shape_im_std, out.mode_count * 3);
}

static void of_deviations(void) {
    for (int method = 0; method < 5; ++method)
        for (int linear = 0; linear < 2; ++linear) gives_the_same(deviation, method + 16 * linear);
    for (int method = 0; method < 2; ++method)
        for (int linear = 0; linear < 2; ++linear) gives_the_same(deviation, method + 8 + 16 * linear);
}

static void refinement(int from_sums) {
    enum { L = 600 };
    okid_real_t A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * 2], C[3 * WIDE_NZ], D[6];
    const int32_t counts[2] = {N - 600, 600};
    const okid_refine_config_t config = {2, 3, WIDE_NZ, from_sums ? 0 : 2, 4, 0, !from_sums};
    const size_t bytes = okid_refine_memsize(&config);
    okid_refine_t* self = NULL;
    okid_refined_t found;
    for (int i = 0; i < WIDE_NZ * WIDE_NZ; ++i) A[i] = (okid_real_t)(rig.A[i] * 0.998);
    for (int i = 0; i < WIDE_NZ * 2; ++i) B[i] = (okid_real_t)(rig.B[i] * 1.1);
    for (int i = 0; i < 3 * WIDE_NZ; ++i) C[i] = (okid_real_t)(rig.C[i] * 0.95);
    for (int i = 0; i < 6; ++i) D[i] = (okid_real_t)rig.D[i];
    const okid_model_t start = {2, 3, WIDE_NZ, A, B, C, D, NULL};
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, filled(bytes), bytes));
    if (from_sums) {
        const okid_correlation_config_t lagged = okid_correlation_defaults(2, 3, L);
        const size_t own = okid_correlation_memsize(&lagged);
        okid_correlation_t* sums = NULL;
        okid_correlation_sums_t made;
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&sums, &lagged, filled(own), own));
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, record, N));
        const size_t room = okid_correlation_sums_memsize(sums);
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(sums, OKID_DETREND_MEAN, &made, filled(room), room));
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_refine_from_correlation(self, &start, &made, &found));
    } else {
        TEST_ASSERT_GREATER_OR_EQUAL(0, okid_refine_run(self, &start, counts, record, &found));
        numbers(found.x0, WIDE_NZ * 2);
    }
    numbers(found.A, WIDE_NZ * WIDE_NZ);
    numbers(found.B, WIDE_NZ * 2);
    numbers(found.C, 3 * WIDE_NZ);
    numbers(found.D, 6);
    numbers(found.noise_std, 3);
    const double others[] = {found.gain, found.decrement, found.whiteness, found.iterations, found.converged};
    take(others, sizeof others);
    for (int k = 0; k < 4; ++k) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_refine_replicate(self, k, A, B, C, D));
        numbers(A, WIDE_NZ * WIDE_NZ);
        numbers(B, WIDE_NZ * 2);
        numbers(C, 3 * WIDE_NZ);
        numbers(D, 6);
    }
}

static void of_a_refinement(void) {
    gives_the_same(refinement, 0);
    gives_the_same(refinement, 1);
}

/// A baseline of some blocks, a test of others, all modes.
static void change(int n_u) {
    okid_change_config_t c = okid_change_defaults(n_u, 3, 6, WIDE_FS);
    const size_t bytes = okid_change_memsize(&c), scratch = sizeof(double) * 60 * 60;
    okid_change_t* self = NULL;
    okid_change_verdict_t out = {0};
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_create(&self, &c, filled(bytes), bytes));
    for (int b = 0; b < 12; ++b) {
        okid_accumulator_t* part = summed(n_u, 11, b * N / 12, (b + 1) * N / 12);
        TEST_ASSERT_EQUAL(OKID_OK, okid_change_add(self, part, filled(scratch)));
        if (b == 6) TEST_ASSERT_GREATER_OR_EQUAL(0, okid_change_learn(self));
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_change_test(self, &out));
    const double verdict[] = {out.statistic, out.p_value, out.freedom, out.modes, out.farthest, out.alarm};
    take(verdict, sizeof verdict);
    TEST_ASSERT_GREATER_THAN(0, out.modes);
    for (int k = 0; k < out.modes; ++k) {
        okid_change_mode_t mode;
        TEST_ASSERT_EQUAL(OKID_OK, okid_change_mode(self, k, &mode));
        take(&mode, sizeof mode);
    }
}

static void of_a_change_test(void) {
    gives_the_same(change, 2);
    gives_the_same(change, 0);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(of_an_identification);
    RUN_TEST(of_deviations);
    RUN_TEST(of_a_refinement);
    RUN_TEST(of_a_change_test);
    return UNITY_END();
}
