// SPDX-License-Identifier: MIT
// The accumulator against an explicit sum over lag windows, for every way a record can be cut.
#include "modal_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 7, N = 600, W = RIG_M * (P + 1) };

static double* samples;
static int16_t* codes;

void setUp(void) {
    rig_t rig;
    rig_make(&rig);
    samples = rig_record(&rig, N, 0.01, NULL, 1);
    codes = malloc(sizeof *codes * N * RIG_M);
    for (int i = 0; i < N * RIG_M; ++i) codes[i] = (int16_t)lrint(fmax(-32000, fmin(32000, samples[i] * 2000)));
}

void tearDown(void) {
    free(samples);
    free(codes);
}

static okid_accumulator_t* make(okid_accumulator_config_t config, void** block) {
    const size_t bytes = okid_accumulator_memsize(&config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    *block = malloc(bytes);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, *block, bytes));
    return a;
}

static okid_accumulator_config_t config_of(okid_sample_t sample) {
    return (okid_accumulator_config_t){RIG_NU, RIG_NY, P, sample, 0, 0, 1.0, 1, 0};
}

/// Reference: every row n in [first, last) whose whole window is free of NaN.
static void reference(const double* v, int first, int last, double* gram) {
    memset(gram, 0, sizeof *gram * W * W);
    for (int n = first; n < last; ++n) {
        double w[W];
        int whole = n >= P;
        for (int lag = 0; lag <= P && whole; ++lag)
            for (int c = 0; c < RIG_M; ++c) {
                w[lag * RIG_M + c] = v[(n - lag) * RIG_M + c];
                if (!isfinite(w[lag * RIG_M + c])) whole = 0;
            }
        if (!whole) continue;
        for (int j = 0; j < W; ++j)
            for (int i = 0; i < W; ++i) gram[j * W + i] += w[i] * w[j];
    }
}

static void same(const double* expected, const double* actual, double tolerance) {
    double scale = 0;
    for (int i = 0; i < W * W; ++i) scale = fmax(scale, fabs(expected[i]));
    for (int i = 0; i < W * W; ++i) TEST_ASSERT_DOUBLE_WITHIN(tolerance * scale + 1e-300, expected[i], actual[i]);
}

static void gram_equals_explicit_sum(void) {
    void* block;
    double expected[W * W], actual[W * W];
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_DOUBLE), &block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples, N));
    reference(samples, 0, N, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    TEST_ASSERT_EQUAL_INT64(N - P, okid_accumulator_rows(a));
    free(block);
}

static void any_split_gives_the_same_bits(void) {
    double whole[W * W], parts[W * W];
    for (int kind = 0; kind < 2; ++kind) {
        void *b1, *b2;
        okid_accumulator_t* a = make(config_of(kind ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE), &b1);
        okid_accumulator_t* b = make(config_of(kind ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE), &b2);
        okid_status_t status = kind ? okid_accumulator_add_i16(a, codes, N) : okid_accumulator_add(a, samples, N);
        TEST_ASSERT_EQUAL(OKID_OK, status);
        uint64_t state = 7;
        for (int n = 0; n < N;) {
            int count = (int)(rig_uniform(&state) * 40);
            if (count > N - n) count = N - n;
            status = kind ? okid_accumulator_add_i16(b, codes + n * RIG_M, (size_t)count)
                          : okid_accumulator_add(b, samples + n * RIG_M, (size_t)count);
            TEST_ASSERT_EQUAL(OKID_OK, status);
            if (n % 3 == 0 && n > P + 40) // looking must not disturb
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_MEAN, parts, NULL));
            n += count;
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, whole, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_NONE, parts, NULL));
        if (kind)
            TEST_ASSERT_EQUAL_MEMORY(whole, parts, sizeof whole);
        else
            same(whole, parts, 1e-13);
        free(b1);
        free(b2);
    }
}

static void codes_are_summed_exactly(void) {
    void* block;
    double actual[W * W];
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_INT16), &block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    for (int j = 0; j < W; ++j)
        for (int i = 0; i < W; ++i) {
            int64_t sum = 0;
            for (int n = P; n < N; ++n)
                sum += (int64_t)codes[(n - i / RIG_M) * RIG_M + i % RIG_M] * codes[(n - j / RIG_M) * RIG_M + j % RIG_M];
            TEST_ASSERT_EQUAL_DOUBLE((double)sum, actual[j * W + i]);
        }
    free(block);
}

/// The FFT path gives the bits of the direct kernel: long and short calls mixed, gaps, full scale, offsets, merging.
static void bulk_equals_direct(void) {
    enum { LONG = 20000 };
    const int shapes[][3] = {{2, 6, 40}, {3, 10, 20}, {1, 3, 70}, {1, 1, 300}, {8, 12, 25}};
    for (size_t k = 0; k < sizeof shapes / sizeof *shapes; ++k) {
        const int m = shapes[k][0] + shapes[k][1], width = m * (shapes[k][2] + 1);
        const size_t gram = (size_t)width * (size_t)width;
        okid_accumulator_config_t config = {
            shapes[k][0], shapes[k][1], shapes[k][2], OKID_SAMPLE_INT16, 0, 0, 1.0, 1, 0, 0};
        void *b1, *b2, *b3;
        okid_accumulator_t* direct = make(config, &b1);
        config.bulk = 1;
        okid_accumulator_t *bulk = make(config, &b2), *other = make(config, &b3);
        TEST_ASSERT_GREATER_THAN(
            okid_accumulator_memsize(&(okid_accumulator_config_t){1, 3, 5, OKID_SAMPLE_INT16, 0, 0, 1.0, 1, 0, 0}),
            okid_accumulator_memsize(&config));
        int16_t* v = malloc(sizeof *v * LONG * (size_t)m);
        double *expected = malloc(sizeof *expected * gram), *actual = malloc(sizeof *actual * gram);
        for (int kind = 0; kind < 4; ++kind) {
            uint64_t state = 3;
            for (int i = 0; i < LONG * m; ++i) {
                const double x = rig_uniform(&state) - 0.5;
                v[i] = (int16_t)(kind == 0   ? 65534 * x
                                 : kind == 1 ? (x < 0 ? -32768 : 32767)
                                 : kind == 2 ? 30000
                                             : 40 * x);
            }
            okid_accumulator_reset(direct);
            okid_accumulator_reset(bulk);
            for (int n = 0, step = 0; n < LONG; n += step) {
                step = (int)(rig_uniform(&state) * 9000);
                if (step > LONG - n) step = LONG - n;
                TEST_ASSERT_GREATER_OR_EQUAL(0, okid_accumulator_add_i16(direct, v + (size_t)n * (size_t)m, 1));
                for (int i = 1; i < step; i += 100) // short calls never take the FFT
                    TEST_ASSERT_GREATER_OR_EQUAL(0,
                                                 okid_accumulator_add_i16(direct, v + (size_t)(n + i) * (size_t)m,
                                                                          (size_t)(step - i < 100 ? step - i : 100)));
                if (step == 0) step = 1;
                TEST_ASSERT_GREATER_OR_EQUAL(0,
                                             okid_accumulator_add_i16(bulk, v + (size_t)n * (size_t)m, (size_t)step));
                if (n < LONG / 2 && n + step >= LONG / 2) {
                    okid_accumulator_gap(direct, 2);
                    okid_accumulator_gap(bulk, 2);
                }
            }
            for (int detrend = 0; detrend < 2; ++detrend) {
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(direct, (okid_detrend_t)detrend, expected, NULL));
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(bulk, (okid_detrend_t)detrend, actual, NULL));
                TEST_ASSERT_EQUAL_MEMORY(expected, actual, sizeof *expected * gram);
            }
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(other, bulk));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(other, OKID_DETREND_MEAN, actual, NULL));
        TEST_ASSERT_EQUAL_MEMORY(expected, actual, sizeof *expected * gram);
        free(v);
        free(expected);
        free(actual);
        free(b1);
        free(b2);
        free(b3);
    }
}

/// Full-scale 24-bit and 32-bit codes: exact against 128-bit sums, whatever the split; merged and windowed too.
static void long_codes_are_summed_exactly(void) {
    static int32_t longs[N * RIG_M];
    static double whole[W * W], parts[W * W];
    for (int kind = OKID_SAMPLE_INT24; kind <= OKID_SAMPLE_INT32; ++kind) {
        const double top = kind == OKID_SAMPLE_INT24 ? 8388607 : 2147483647;
        uint64_t state = 5;
        for (int i = 0; i < N * RIG_M; ++i) longs[i] = (int32_t)(top * (2 * rig_uniform(&state) - 1));
        for (int i = 200 * RIG_M; i < 260 * RIG_M; ++i) longs[i] = (int32_t)(i % 3 ? top : -top - 1); // the extremes
        void *b1, *b2, *b3;
        okid_accumulator_t *a = make(config_of((okid_sample_t)kind), &b1),
                           *b = make(config_of((okid_sample_t)kind), &b2),
                           *c = make(config_of((okid_sample_t)kind), &b3);
        TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i32(a, longs, N));
        for (int n = 0; n < N; n += 37)
            TEST_ASSERT_GREATER_OR_EQUAL(
                0, okid_accumulator_add_i32(b, longs + n * RIG_M, n + 37 < N ? 37 : (size_t)(N - n)));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, whole, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_NONE, parts, NULL));
        TEST_ASSERT_EQUAL_MEMORY(whole, parts, sizeof whole);
        for (int j = 0; j < W; ++j)
            for (int i = 0; i < W; ++i) {
                __int128 sum = 0;
                for (int n = P; n < N; ++n)
                    sum += (__int128)longs[(n - i / RIG_M) * RIG_M + i % RIG_M] *
                           longs[(n - j / RIG_M) * RIG_M + j % RIG_M];
                TEST_ASSERT_EQUAL_DOUBLE((double)sum, whole[j * W + i]);
            }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(c, a));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(c, b));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(c, OKID_DETREND_NONE, parts, NULL));
        for (int i = 0; i < W * W; ++i) TEST_ASSERT_EQUAL_DOUBLE(2 * whole[i], parts[i]);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, whole, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(c, OKID_DETREND_MEAN, parts, NULL));
        for (int i = 0; i < W * W; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-12 * fabs(whole[0]), 2 * whole[i], parts[i]);
        longs[3] = INT32_MAX;
        TEST_ASSERT_EQUAL(kind == OKID_SAMPLE_INT24 ? OKID_ERR_RANGE : OKID_WARN_SATURATED,
                          okid_accumulator_add_i32(a, longs, 5));
        free(b1);
        free(b2);
        free(b3);
    }
}

/// A small signal on a large offset: what is left after centring has every digit of the codes.
static void offsets_of_codes_cost_no_digits(void) {
    void *b1, *b2;
    static double plain[W * W], shifted[W * W];
    okid_accumulator_t *a = make(config_of(OKID_SAMPLE_INT32), &b1), *b = make(config_of(OKID_SAMPLE_INT32), &b2);
    static int32_t small[N * RIG_M], large[N * RIG_M];
    for (int i = 0; i < N * RIG_M; ++i) {
        small[i] = codes[i] / 1000;
        large[i] = small[i] + 2000000000;
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i32(a, small, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i32(b, large, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, plain, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_MEAN, shifted, NULL));
    TEST_ASSERT_EQUAL_MEMORY(plain, shifted, sizeof plain);
    free(b1);
    free(b2);
}

static void missing_samples_drop_exactly_the_rows_they_touch(void) {
    void* block;
    double expected[W * W], actual[W * W];
    samples[100 * RIG_M + 2] = NAN;
    samples[101 * RIG_M] = INFINITY;
    samples[300 * RIG_M + 1] = NAN;
    samples[304 * RIG_M + 1] = NAN; // closer than a lag window
    samples[(N - 2) * RIG_M] = NAN;
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_DOUBLE), &block);
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_accumulator_add(a, samples, N));
    reference(samples, 0, N, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    okid_accumulator_stats_t stats;
    okid_accumulator_stats(a, &stats);
    TEST_ASSERT_EQUAL_INT64(5, stats.missing);
    TEST_ASSERT_EQUAL_INT64(4, stats.gaps);
    TEST_ASSERT_EQUAL_INT64(N - 5, stats.samples);
    free(block);
}

static void offsets_leave_without_a_second_pass(void) {
    void *b1, *b2;
    double plain[W * W], centred[W * W], mean[RIG_M];
    okid_accumulator_t *a = make(config_of(OKID_SAMPLE_DOUBLE), &b1), *b = make(config_of(OKID_SAMPLE_DOUBLE), &b2);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples, N));
    for (int i = 0; i < N * RIG_M; ++i) samples[i] += 5 + i % RIG_M;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(b, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, plain, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_MEAN, centred, mean));
    same(plain, centred, 1e-11);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 5, mean[0]);
    free(b1);
    free(b2);
}

static void units_scale_codes(void) {
    void *b1, *b2;
    double expected[W * W], actual[W * W];
    const double scale[RIG_M] = {0.5, 2, 0.001, 1}, offset[RIG_M] = {1, -3, 0.25, 0};
    okid_accumulator_t *a = make(config_of(OKID_SAMPLE_INT16), &b1), *b = make(config_of(OKID_SAMPLE_DOUBLE), &b2);
    okid_accumulator_set_units(a, scale, offset);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, N));
    for (int i = 0; i < N * RIG_M; ++i) samples[i] = codes[i] * scale[i % RIG_M] + offset[i % RIG_M];
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(b, samples, N));
    for (int detrend = 0; detrend < 2; ++detrend) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, (okid_detrend_t)detrend, expected, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, (okid_detrend_t)detrend, actual, NULL));
        same(expected, actual, 1e-11);
    }
    free(b1);
    free(b2);
}

static void window_forgets_completely(void) {
    void* block;
    double expected[W * W], actual[W * W];
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    config.block = 50;
    config.slots = 4;
    config.edges = 0;
    okid_accumulator_t* a = make(config, &block);
    for (int n = 0; n < 450 + P; n += 10)
        TEST_ASSERT_EQUAL(OKID_OK,
                          okid_accumulator_add(a, samples + n * RIG_M, n + 10 > 450 + P ? (size_t)(450 + P - n) : 10));
    TEST_ASSERT_EQUAL_INT64(200, okid_accumulator_rows(a));
    reference(samples, 450 + P - 200, 450 + P, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    free(block);
}

static void window_with_gaps(void) {
    void* block;
    double expected[W * W], actual[W * W];
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    config.block = 50;
    config.slots = 4;
    config.spare_slots = 4;
    okid_accumulator_t* a = make(config, &block);
    samples[400 * RIG_M] = samples[470 * RIG_M + 1] = NAN;
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_accumulator_add(a, samples, N));
    const int rows = (int)okid_accumulator_rows(a);
    int first = N; // the window is the newest `rows` whole rows
    for (int left = rows; left > 0;) {
        --first;
        int whole = 1;
        for (int lag = 0; lag <= P; ++lag) whole &= !(first - lag == 400 || first - lag == 470);
        left -= whole;
    }
    TEST_ASSERT_GREATER_THAN(120, rows);
    TEST_ASSERT_LESS_THAN(251, N - first);
    reference(samples, first, N, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    free(block);
}

static void forgetting_fades_whole_blocks(void) {
    void* block;
    double expected[W * W], part[W * W], actual[W * W];
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_INT16);
    config.block = 100;
    config.forgetting = 0.99;
    okid_accumulator_t* a = make(config, &block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, 350 + P));
    for (int i = 0; i < N * RIG_M; ++i) samples[i] = codes[i];
    memset(expected, 0, sizeof expected);
    for (int b = 0; b < 4; ++b) { // three closed blocks, the newest closed one unfaded, and the open half block
        const int last = P + (b + 1) * 100;
        reference(samples, P + b * 100, last < 350 + P ? last : 350 + P, part);
        const double weight = b < 3 ? pow(0.99, 100.0 * (2 - b)) : 1;
        for (int i = 0; i < W * W; ++i) expected[i] += weight * part[i];
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    free(block);
}

static void merge_is_exact(void) {
    void *b1, *b2, *b3;
    double expected[W * W], actual[W * W];
    okid_accumulator_t *a = make(config_of(OKID_SAMPLE_INT16), &b1), *b = make(config_of(OKID_SAMPLE_INT16), &b2),
                       *c = make(config_of(OKID_SAMPLE_INT16), &b3);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, 200));
    okid_accumulator_gap(a, 3);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes + 200 * RIG_M, 100));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(b, codes + 300 * RIG_M, 300));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(c, b));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(c, a));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(a, b));
    TEST_ASSERT_EQUAL_INT64(okid_accumulator_rows(a), okid_accumulator_rows(c));
    for (int detrend = 0; detrend < 2; ++detrend) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, (okid_detrend_t)detrend, expected, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(c, (okid_detrend_t)detrend, actual, NULL));
        TEST_ASSERT_EQUAL_MEMORY(expected, actual, sizeof actual);
    }
    okid_accumulator_config_t other = config_of(OKID_SAMPLE_DOUBLE);
    void* b4;
    okid_accumulator_t* d = make(other, &b4);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_merge(a, d));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_merge(a, a));
    free(b1);
    free(b2);
    free(b3);
    free(b4);
}

static void a_copy_of_the_block_is_a_snapshot(void) {
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_INT16);
    const size_t bytes = okid_accumulator_memsize(&config);
    void *block = malloc(bytes), *copy = malloc(bytes);
    okid_accumulator_t *a, *b;
    double now[W * W], later[W * W];
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, 333));
    memcpy(copy, block, bytes);
    b = (okid_accumulator_t*)((char*)copy + ((char*)a - (char*)block));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, now, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(a, codes, 200));
    memset(block, 0xA5, bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, OKID_DETREND_MEAN, later, NULL));
    TEST_ASSERT_EQUAL_MEMORY(now, later, sizeof now);
    free(block);
    free(copy);
}

static void without_edges_a_second_run_replaces_the_first(void) {
    void* block;
    double expected[W * W], actual[W * W];
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    config.edges = 0;
    okid_accumulator_t* a = make(config, &block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples, 200));
    okid_accumulator_gap(a, 1);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    reference(samples, 0, 200, expected);
    same(expected, actual, 1e-13);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples + 201 * RIG_M, 300));
    reference(samples, 201 + P, 501, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, actual, NULL));
    same(expected, actual, 1e-13);
    okid_accumulator_stats_t stats;
    okid_accumulator_stats(a, &stats);
    TEST_ASSERT_EQUAL_INT64(200 - P, stats.dropped);
    free(block);
}

static void saturation_is_counted_and_absorbed(void) {
    void* block;
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_INT16), &block);
    codes[40] = INT16_MAX;
    codes[90] = INT16_MIN;
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(a, codes, N));
    okid_accumulator_stats_t stats;
    okid_accumulator_stats(a, &stats);
    TEST_ASSERT_EQUAL_INT64(2, stats.saturated);
    TEST_ASSERT_EQUAL_INT64(N, stats.samples);
    free(block);
}

static void reset_forgets(void) {
    void* block;
    double first[W * W], second[W * W];
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_DOUBLE), &block);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, first, NULL));
    okid_accumulator_gap(a, 9);
    okid_accumulator_reset(a);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_accumulator_gram(a, OKID_DETREND_MEAN, second, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, samples, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, second, NULL));
    TEST_ASSERT_EQUAL_MEMORY(first, second, sizeof first);
    free(block);
}

static void wrong_use_is_refused(void) {
    okid_accumulator_t* a = NULL;
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    char small[64];
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_accumulator_create(&a, &config, small, sizeof small));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_create(NULL, &config, small, sizeof small));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_create(&a, &config, NULL, 1));
    const okid_accumulator_config_t bad[] = {
        {1, 0, P, OKID_SAMPLE_DOUBLE, 0, 0, 1, 1, 0},   {-1, 3, P, OKID_SAMPLE_DOUBLE, 0, 0, 1, 1, 0},
        {1, 3, 0, OKID_SAMPLE_DOUBLE, 0, 0, 1, 1, 0},   {1, 3, P, (okid_sample_t)9, 0, 0, 1, 1, 0},
        {1, 3, P, OKID_SAMPLE_DOUBLE, 0, 0, 0, 1, 0},   {1, 3, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.5, 1, 0},
        {1, 3, P, OKID_SAMPLE_DOUBLE, 0, 4, 1, 1, 0},   {1, 3, P, OKID_SAMPLE_DOUBLE, 50, 4, 0.9, 1, 0},
        {1, 3, P, OKID_SAMPLE_DOUBLE, 0, 0, 0.9, 1, 0}, {200, 200, P, OKID_SAMPLE_DOUBLE, 0, 0, 1, 1, 0},
        {1, 3, P, OKID_SAMPLE_DOUBLE, 50, 0, 1, 0, 0},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
        TEST_ASSERT_EQUAL(0, okid_accumulator_memsize(&bad[i]));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_create(&a, &bad[i], small, sizeof small));
    }
    void* block;
    a = make(config, &block);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_add_i16(a, codes, 3));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_add(a, NULL, 3));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, NULL, 0));
    free(block);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(gram_equals_explicit_sum);
    RUN_TEST(any_split_gives_the_same_bits);
    RUN_TEST(codes_are_summed_exactly);
    RUN_TEST(bulk_equals_direct);
    RUN_TEST(long_codes_are_summed_exactly);
    RUN_TEST(offsets_of_codes_cost_no_digits);
    RUN_TEST(missing_samples_drop_exactly_the_rows_they_touch);
    RUN_TEST(offsets_leave_without_a_second_pass);
    RUN_TEST(units_scale_codes);
    RUN_TEST(window_forgets_completely);
    RUN_TEST(window_with_gaps);
    RUN_TEST(forgetting_fades_whole_blocks);
    RUN_TEST(merge_is_exact);
    RUN_TEST(a_copy_of_the_block_is_a_snapshot);
    RUN_TEST(without_edges_a_second_run_replaces_the_first);
    RUN_TEST(saturation_is_counted_and_absorbed);
    RUN_TEST(reset_forgets);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
