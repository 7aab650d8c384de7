// SPDX-License-Identifier: MIT
// Refinement from correlation sums beside that from the record: the same maximum, gaps, offsets, the deviations in any
// states, wrong use.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { N = 12000, L = 3700, DRAWS = 64 };

static rig_t rig;
static okid_real_t A[RIG_NZ * RIG_NZ], B[RIG_NZ], C[RIG_NY * RIG_NZ], D[RIG_NY];
static okid_model_t start = {RIG_NU, RIG_NY, RIG_NZ, A, B, C, D, NULL};
static okid_refined_t found;
static okid_refine_t* self;
static void *block, *room;

/// The truth, every number wrong by some percent.
void setUp(void) {
    uint64_t state = 77;
    rig_make(&rig);
    for (int i = 0; i < RIG_NZ * RIG_NZ; ++i) A[i] = (okid_real_t)(rig.A[i] * 0.999);
    for (int i = 0; i < RIG_NZ; ++i) B[i] = (okid_real_t)(rig.B[i] * (1 + 0.02 * rig_normal(&state)));
    for (int i = 0; i < RIG_NY * RIG_NZ; ++i) C[i] = (okid_real_t)(rig.C[i] * (1 + 0.02 * rig_normal(&state)));
    for (int i = 0; i < RIG_NY; ++i) D[i] = (okid_real_t)(rig.D[i] * 1.01);
}
void tearDown(void) {
    free(block);
    free(room);
    block = room = NULL;
}

static void make_refine(int runs, int blocks) {
    const okid_refine_config_t config = {RIG_NU, RIG_NY, RIG_NZ, runs, blocks, 0, 0};
    const size_t bytes = okid_refine_memsize(&config);
    free(block);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_create(&self, &config, block, bytes));
}

static okid_correlation_sums_t sums_of(const double* v, int first, int count, int second, int lags,
                                       okid_detrend_t detrend) {
    okid_correlation_config_t config = okid_correlation_defaults(RIG_NU, RIG_NY, lags);
    config.slots = 2;
    void* memory = malloc(okid_correlation_memsize(&config));
    okid_correlation_t* sums = NULL;
    okid_correlation_sums_t out;
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&sums, &config, memory, okid_correlation_memsize(&config)));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, v + first * RIG_M, (size_t)count));
    if (second > 0) {
        okid_correlation_gap(sums, 10);
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add(sums, v + (first + count + 10) * RIG_M, (size_t)second));
    }
    const size_t bytes = okid_correlation_sums_memsize(sums);
    free(room);
    room = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(sums, detrend, &out, room, bytes));
    free(memory);
    return out;
}

static void modes_of(const okid_real_t* a, const okid_real_t* c, double* out) {
    const size_t bytes = okid_modal_memsize(RIG_NY, RIG_NZ);
    void* work = malloc(bytes);
    okid_real_t f[RIG_NZ], zeta[RIG_NZ];
    const okid_model_t model = {.n_u = RIG_NU, .n_y = RIG_NY, .n_z = RIG_NZ, .A = a, .C = c};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta};
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, 1 / RIG_FS, &modes, work, bytes));
    TEST_ASSERT_EQUAL(RIG_MODES, modes.count);
    for (int k = 0; k < RIG_MODES; ++k) {
        out[k] = (double)f[k];
        out[RIG_MODES + k] = (double)zeta[k];
    }
    free(work);
}

/// Deviations of f and zeta by the draws.
static void deviations_of(const double* full, double* out) {
    static okid_real_t a[RIG_NZ * RIG_NZ], b[RIG_NZ], c[RIG_NY * RIG_NZ], d[RIG_NY];
    double one[2 * RIG_MODES];
    memset(out, 0, 2 * RIG_MODES * sizeof *out);
    for (int j = 0; j < DRAWS; ++j) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_refine_replicate(self, j, a, b, c, d));
        modes_of(a, c, one);
        for (int k = 0; k < 2 * RIG_MODES; ++k) out[k] += pow(one[k] - full[k], 2) * (DRAWS - 1) / DRAWS;
    }
    for (int k = 0; k < 2 * RIG_MODES; ++k) out[k] = sqrt(out[k]);
}

/// Sums and record of the same rows have nearly the same maximum: an initial state is known in one and found in the other.
static void sums_and_record_find_the_same(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 3);
    double from_sums[2 * RIG_MODES], from_record[2 * RIG_MODES], deviation[2 * RIG_MODES];
    const okid_correlation_sums_t sums = sums_of(v, 0, N, 0, L, OKID_DETREND_NONE);
    make_refine(0, DRAWS);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &sums, &found));
    TEST_ASSERT_EQUAL(1, found.converged);
    TEST_ASSERT_TRUE(found.x0 == NULL && found.iterations > 0 && found.gain > 0);
    TEST_ASSERT_EQUAL_INT64(N - L, found.samples);
    for (int o = 0; o < RIG_NY; ++o) TEST_ASSERT_TRUE(fabs((double)found.noise_std[o] / 0.15 - 1) < 0.03);
    modes_of(found.A, found.C, from_sums);
    deviations_of(from_sums, deviation);
    const int32_t count = N - L;
    make_refine(1, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_run(self, &start, &count, v + L * RIG_M, &found));
    modes_of(found.A, found.C, from_record);
    for (int k = 0; k < 2 * RIG_MODES; ++k) TEST_ASSERT_TRUE(fabs(from_sums[k] - from_record[k]) < 0.5 * deviation[k]);
    free(v);
}

static void errors_scatter_as_the_draws_say(void) {
    enum { RECORDS = 12 };
    double share = 0;
    for (int r = 0; r < RECORDS; ++r) {
        double* v = rig_record(&rig, N, 0.05, NULL, 200 + (uint64_t)r);
        double full[2 * RIG_MODES], deviation[2 * RIG_MODES];
        const int gap = r % 2 == 0 ? N / 2 : 0; // half of them in two runs
        const okid_correlation_sums_t sums = sums_of(v, 0, N - gap - (gap > 0 ? 10 : 0), gap, L, OKID_DETREND_NONE);
        make_refine(0, DRAWS);
        TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &sums, &found));
        TEST_ASSERT_EQUAL_INT64(gap > 0 ? N - 10 - 2 * L : N - L, found.samples);
        modes_of(found.A, found.C, full);
        deviations_of(full, deviation);
        for (int k = 0; k < 2 * RIG_MODES; ++k) {
            const double truth = k < RIG_MODES ? rig_frequency[k] : rig_damping[k - RIG_MODES];
            share += pow((full[k] - truth) / deviation[k], 2) / (2 * RIG_MODES * RECORDS);
        }
        free(v);
    }
    TEST_ASSERT_TRUE(share > 0.6 && share < 1.6); // 72 squares: 1.0 +- 0.17
}

/// start in other states: the sign of one turned, or x' = T x of a random orthogonal T (plane rotations, then signs).
static void turn_states(int states, uint64_t* seed) {
    const int first = states < RIG_NZ ? states : 0;
    for (int turn = 0; turn < (states < RIG_NZ ? 0 : 3 * RIG_NZ); ++turn) {
        const int i = turn % RIG_NZ, j = (turn + 1 + turn / RIG_NZ) % RIG_NZ;
        const double angle = 3 * rig_normal(seed), c = cos(angle), s = sin(angle);
        for (int k = 0; k < RIG_NZ; ++k) {
            const double x = (double)A[k + i * RIG_NZ], y = (double)A[k + j * RIG_NZ];
            A[k + i * RIG_NZ] = (okid_real_t)(c * x - s * y);
            A[k + j * RIG_NZ] = (okid_real_t)(s * x + c * y);
        }
        for (int k = 0; k < RIG_NZ; ++k) {
            const double x = (double)A[i + k * RIG_NZ], y = (double)A[j + k * RIG_NZ];
            A[i + k * RIG_NZ] = (okid_real_t)(c * x - s * y);
            A[j + k * RIG_NZ] = (okid_real_t)(s * x + c * y);
        }
        const double x = (double)B[i], y = (double)B[j];
        B[i] = (okid_real_t)(c * x - s * y);
        B[j] = (okid_real_t)(s * x + c * y);
        for (int o = 0; o < RIG_NY; ++o) {
            const double p = (double)C[o + i * RIG_NY], q = (double)C[o + j * RIG_NY];
            C[o + i * RIG_NY] = (okid_real_t)(c * p - s * q);
            C[o + j * RIG_NY] = (okid_real_t)(s * p + c * q);
        }
    }
    for (int k = 0; k < RIG_NZ; ++k) {
        A[first + k * RIG_NZ] = -A[first + k * RIG_NZ];
        A[k + first * RIG_NZ] = -A[k + first * RIG_NZ];
    }
    B[first] = -B[first];
    for (int o = 0; o < RIG_NY; ++o) C[o + first * RIG_NY] = -C[o + first * RIG_NY];
}

/// Modes, gain and deviations do not know in which states the start was written.
static void deviations_do_not_depend_on_the_states(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 3);
    double full[2 * RIG_MODES], deviation[2 * RIG_MODES], same[2 * RIG_MODES], other[2 * RIG_MODES];
    const okid_correlation_sums_t sums = sums_of(v, 0, N, 0, L, OKID_DETREND_NONE);
    uint64_t seed = 9;
    make_refine(0, DRAWS);
    for (int states = -1; states < RIG_NZ + 10; ++states) {
        setUp();
        if (states >= 0) turn_states(states, &seed);
        TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &sums, &found));
        modes_of(found.A, found.C, states < 0 ? full : same);
        deviations_of(states < 0 ? full : same, states < 0 ? deviation : other);
        for (int k = 0; k < 2 * RIG_MODES && states >= 0; ++k) {
            TEST_ASSERT_TRUE(fabs(same[k] / full[k] - 1) < TOLERANCE(1e-9, 2e-4));
            if (sizeof(okid_real_t) < sizeof(double)) continue; // a deviation is smaller than the rounding of f
            TEST_ASSERT_TRUE(fabs(other[k] / deviation[k] - 1) < 1e-7);
        }
    }
    free(v);
}

static void a_moving_start_and_offsets_do_no_harm(void) {
    double x0[RIG_NZ] = {30, -20, 10, 10, -5, 8}, plain[2 * RIG_MODES], moved[2 * RIG_MODES];
    double* v = rig_record(&rig, N, 0.01, x0, 4);
    okid_correlation_sums_t sums = sums_of(v, 0, N, 0, L, OKID_DETREND_MEAN);
    make_refine(0, 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &sums, &found));
    modes_of(found.A, found.C, plain);
    for (int k = 0; k < RIG_MODES; ++k) {
        TEST_ASSERT_TRUE(fabs(plain[k] / rig_frequency[k] - 1) < 2e-5);
        TEST_ASSERT_TRUE(fabs(plain[RIG_MODES + k] / rig_damping[k] - 1) < 2e-3);
    }
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < RIG_M; ++c) v[n * RIG_M + c] += 40 - 30 * c;
    sums = sums_of(v, 0, N, 0, L, OKID_DETREND_MEAN);
    TEST_ASSERT_EQUAL(OKID_OK, okid_refine_from_correlation(self, &start, &sums, &found));
    modes_of(found.A, found.C, moved);
    for (int k = 0; k < 2 * RIG_MODES; ++k) TEST_ASSERT_TRUE(fabs(moved[k] / plain[k] - 1) < TOLERANCE(1e-9, 2e-4));
    free(v);
}

static void wrong_use_is_refused(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 3);
    okid_correlation_sums_t sums = sums_of(v, 0, N, 0, L, OKID_DETREND_NONE);
    const int32_t count = N;
    make_refine(0, 0);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_refine_run(self, &start, &count, v, &found)); // made for sums
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_refine_from_correlation(self, &start, NULL, &found));
    okid_correlation_sums_t other = sums;
    other.n_y = 2;
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_refine_from_correlation(self, &start, &other, &found));
    other = sums;
    other.rows = 10;
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_refine_from_correlation(self, &start, &other, &found));
    make_refine(1, 0);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_refine_from_correlation(self, &start, &sums, &found)); // made for records
    make_refine(0, 0);
    sums = sums_of(v, 0, N, 0, 500, OKID_DETREND_NONE); // the first mode rings on for 8 times as long
    TEST_ASSERT_EQUAL(OKID_ERR_UNSTABLE, okid_refine_from_correlation(self, &start, &sums, &found));
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(sums_and_record_find_the_same);
    RUN_TEST(errors_scatter_as_the_draws_say);
    RUN_TEST(deviations_do_not_depend_on_the_states);
    RUN_TEST(a_moving_start_and_offsets_do_no_harm);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
