// SPDX-License-Identifier: MIT
// A billion samples at full scale: nothing overflows, nothing drifts, the Gram matrix stays positive definite. Growing sums
// get there by merging a record with copies of itself; windows and forgetting are sampled (OKID_SLOW=1: every sample is fed).
#include <math.h>
#include <okid/okid.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { M = 3, P = 4, W = M * (P + 1), N = 4096, DOUBLINGS = 18 }; // 4096 2^18 = 2^30

static int32_t codes[N * M];
static int16_t words[N * M];
static double samples[N * M];

static uint32_t noise(uint64_t* state) {
    *state = *state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (uint32_t)(*state >> 32);
}

/// Codes that stand at full scale, one way or the other, three times of four.
static void fill(int bits) {
    uint64_t state = 7;
    const int32_t top = (int32_t)((UINT32_C(1) << (bits - 1)) - 1);
    for (int i = 0; i < N * M; ++i) {
        const uint32_t draw = noise(&state);
        codes[i] = draw % 4 == 0 ? (int32_t)(draw >> 1) >> (31 - (bits - 1)) : draw & 64 ? top : -top - 1;
        words[i] = (int16_t)(bits == 16 ? codes[i] : 0);
        samples[i] = codes[i];
    }
}

void setUp(void) {}
void tearDown(void) {}

static okid_status_t feed(okid_accumulator_t* a, okid_sample_t sample, int count) {
    if (sample == OKID_SAMPLE_DOUBLE) return okid_accumulator_add(a, samples, (size_t)count);
    if (sample == OKID_SAMPLE_INT16) return okid_accumulator_add_i16(a, words, (size_t)count);
    return okid_accumulator_add_i32(a, codes, (size_t)count);
}

static int positive_definite(const double* gram) {
    double l[W * W];
    memcpy(l, gram, sizeof l);
    for (int k = 0; k < W; ++k) {
        for (int j = 0; j < k; ++j)
            for (int i = k; i < W; ++i) l[k * W + i] -= l[j * W + i] * l[j * W + k];
        if (!(l[k * W + k] > 1e-9 * gram[k * W + k])) return 0;
        const double root = sqrt(l[k * W + k]);
        for (int i = k; i < W; ++i) l[k * W + i] /= root;
    }
    return 1;
}

static okid_accumulator_t* make(const okid_accumulator_config_t* config, void** block, size_t* bytes) {
    okid_accumulator_t* a = NULL;
    *bytes = okid_accumulator_memsize(config);
    *block = aligned_alloc(64, (*bytes + 63) / 64 * 64);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, config, *block, *bytes));
    return a;
}

/// The Gram matrix of 2^30 samples is that of 2^12 times 2^18, bit for bit: a power of two changes no digit.
static void a_billion_samples_add_up_exactly(void) {
    const struct {
        okid_sample_t sample;
        int bits;
    } kinds[] = {{OKID_SAMPLE_INT16, 16}, {OKID_SAMPLE_INT24, 24}, {OKID_SAMPLE_INT32, 32}};
    for (int k = 0; k < 3; ++k) {
        fill(kinds[k].bits);
        const okid_accumulator_config_t config = {
            .n_u = 1, .n_y = M - 1, .lags = P, .sample = kinds[k].sample, .forgetting = 1, .edges = 1};
        void *block, *other;
        size_t bytes;
        okid_accumulator_t *a = make(&config, &block, &bytes), *b = make(&config, &other, &bytes);
        double once[2][W * W], gram[W * W];
        TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, feed(a, kinds[k].sample, N));
        for (int d = 0; d < 2; ++d)
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, (okid_detrend_t)d, once[d], NULL));
        for (int doubling = 0; doubling < DOUBLINGS; ++doubling) {
            memcpy(other, block, bytes);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(a, b));
        }
        TEST_ASSERT_EQUAL_INT64((int64_t)(N - P) << DOUBLINGS, okid_accumulator_rows(a));
        for (int d = 0; d < 2; ++d) {
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, (okid_detrend_t)d, gram, NULL));
            for (int i = 0; i < W * W; ++i) TEST_ASSERT_EQUAL_DOUBLE(ldexp(once[d][i], DOUBLINGS), gram[i]);
            TEST_ASSERT_TRUE(positive_definite(gram));
        }
        okid_status_t status = OKID_OK; // and on, until the sums of full-scale codes would leave their words
        while (status == OKID_OK) {
            memcpy(other, block, bytes);
            status = okid_accumulator_merge(a, b);
        }
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, status);
        const int64_t limit = INT64_C(1) << (kinds[k].bits == 16 ? 48 : kinds[k].bits == 24 ? 40 : 32);
        TEST_ASSERT_TRUE(okid_accumulator_rows(a) <= limit && okid_accumulator_rows(a) > limit / 2);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, gram, NULL));
        TEST_ASSERT_TRUE(positive_definite(gram));
        free(block);
        free(other);
    }
}

/// A window forgets: after bursts spread over a billion sample periods it holds what a fresh one holds after the last.
static void a_window_does_not_drift(void) {
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    const int bits[] = {24, 16, 24, 32}, bursts = getenv("OKID_SLOW") ? 244141 : 400; // 244141 * 4096 = 1e9
    for (int k = 0; k < 4; ++k) {
        fill(bits[k]);
        const okid_accumulator_config_t config = {.n_u = 1,
                                                  .n_y = M - 1,
                                                  .lags = P,
                                                  .sample = kinds[k],
                                                  .block = 100,
                                                  .slots = 10,
                                                  .forgetting = 1,
                                                  .spare_slots = 4};
        void *block, *other;
        size_t bytes;
        okid_accumulator_t *a = make(&config, &block, &bytes), *fresh = make(&config, &other, &bytes);
        double old[W * W], young[W * W];
        for (int burst = 0; burst < bursts; ++burst) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, feed(a, kinds[k], N));
            okid_accumulator_gap(a, 1000000000 / bursts - N);
        }
        okid_accumulator_gap(fresh, 5);
        TEST_ASSERT_GREATER_OR_EQUAL(0, feed(a, kinds[k], N));
        TEST_ASSERT_GREATER_OR_EQUAL(0, feed(fresh, kinds[k], N));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, old, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(fresh, OKID_DETREND_MEAN, young, NULL));
        TEST_ASSERT_EQUAL_MEMORY(young, old, sizeof old);
        TEST_ASSERT_TRUE(positive_definite(old));
        free(block);
        free(other);
    }
}

/// Forgetting reaches the sum of the geometric series and stays there.
static void forgetting_settles(void) {
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    const int bits[] = {24, 16, 24, 32}, passes = getenv("OKID_SLOW") ? 244141 : 200;
    for (int k = 0; k < 4; ++k) {
        fill(bits[k]);
        const okid_accumulator_config_t config = {
            .n_u = 1, .n_y = M - 1, .lags = P, .sample = kinds[k], .block = N, .forgetting = 0.9999, .edges = 1};
        void* block;
        size_t bytes;
        okid_accumulator_t* a = make(&config, &block, &bytes);
        double early[W * W], late[W * W];
        for (int pass = 0; pass < passes; ++pass) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, feed(a, kinds[k], N));
            if (pass == 99) TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, early, NULL));
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, late, NULL));
        for (int i = 0; i < W * W; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-13 * late[0], early[i], late[i]);
        TEST_ASSERT_TRUE(positive_definite(early));
        TEST_ASSERT_TRUE(positive_definite(late));
        free(block);
    }
}

/// The written state of codes is the same on every processor and in every build: its CRC is a constant.
static void the_written_state_is_the_same_everywhere(void) {
    fill(16);
    const okid_accumulator_config_t config = {
        .n_u = 1, .n_y = M - 1, .lags = P, .sample = OKID_SAMPLE_INT16, .forgetting = 1, .edges = 1};
    void* block;
    size_t bytes;
    okid_accumulator_t* a = make(&config, &block, &bytes);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, feed(a, OKID_SAMPLE_INT16, N));
    okid_accumulator_gap(a, 3);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, feed(a, OKID_SAMPLE_INT16, N / 2));
    const size_t size = okid_accumulator_serialised_size(a);
    unsigned char* out = malloc(size);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(a, out, size));
    TEST_ASSERT_EQUAL(3140, size);
    TEST_ASSERT_EQUAL_HEX32(0x0182FEAD,
                            out[size - 4] | out[size - 3] << 8 | out[size - 2] << 16 | (uint32_t)out[size - 1] << 24);
    free(out);
    free(block);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(a_billion_samples_add_up_exactly);
    RUN_TEST(a_window_does_not_drift);
    RUN_TEST(forgetting_settles);
    RUN_TEST(the_written_state_is_the_same_everywhere);
    return UNITY_END();
}
