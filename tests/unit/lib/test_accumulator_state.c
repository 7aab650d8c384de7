// SPDX-License-Identifier: MIT
// What is kept of an accumulator: its memory, its written form, its sums of one run, records centred one by one.
#include "modal_rig.h"
#include "same_sums.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 7, N = 600, M = RIG_M, W = M * (P + 1) };

static double* samples;
static int32_t codes[N * M];
static int16_t words[N * M];

void setUp(void) {
    rig_t rig;
    rig_make(&rig);
    samples = rig_record(&rig, N, 0.01, NULL, 1);
    for (int i = 0; i < N * M; ++i) {
        words[i] = (int16_t)lrint(fmax(-32000, fmin(32000, samples[i] * 2000 + 137 * (i % M))));
        codes[i] = words[i] * 211;
    }
}
void tearDown(void) { free(samples); }

static okid_accumulator_t* make(okid_accumulator_config_t config, void** block) {
    const size_t bytes = okid_accumulator_memsize(&config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    *block = malloc(bytes);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, *block, bytes));
    return a;
}

static okid_accumulator_config_t config_of(okid_sample_t sample) {
    return (okid_accumulator_config_t){
        .n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .sample = sample, .forgetting = 1, .edges = 1};
}

static okid_status_t feed(okid_accumulator_t* a, okid_sample_t sample, int first, int count) {
    const size_t at = (size_t)(first * M), n = (size_t)count;
    if (sample == OKID_SAMPLE_DOUBLE) return okid_accumulator_add(a, samples + at, n);
    if (sample == OKID_SAMPLE_INT16) return okid_accumulator_add_i16(a, words + at, n);
    return okid_accumulator_add_i32(a, codes + at, n);
}

static void same_bits(okid_accumulator_t* a, okid_accumulator_t* b) { same_sums(a, b, W); }

static void bytes_go_on_bit_for_bit(void) {
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    for (int kind = 0; kind < 4; ++kind)
        for (int mode = 0; mode < 4; ++mode) { // growing, one run, window, forgetting
            okid_accumulator_config_t config = config_of(kinds[kind]);
            config.edges = mode != 1 && mode != 2;
            config.block = mode >= 2 ? 50 : 0;
            config.slots = mode == 2 ? 4 : 0;
            config.spare_slots = mode == 2 ? 2 : 0;
            config.forgetting = mode == 3 ? 0.999 : 1;
            void *block, *other;
            okid_accumulator_t* a = make(config, &block);
            okid_accumulator_set_units(a, (double[]){2, 3, 4, 5}, (double[]){1, 0, -1, 2});
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, kinds[kind], 0, 200));
            if (mode != 1) okid_accumulator_gap(a, 3);
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, kinds[kind], 200, 217));
            const size_t size = okid_accumulator_serialised_size(a);
            void* bytes = malloc(size);
            TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_accumulator_serialise(a, bytes, size - 1));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(a, bytes, size));
            okid_accumulator_config_t found;
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_peek(bytes, size, &found));
            found.buffer = 1; // the reader's own business
            okid_accumulator_t* b = make(found, &other);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(b, bytes, size));
            same_bits(a, b);
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, kinds[kind], 417, N - 417));
            TEST_ASSERT_EQUAL(OKID_OK, feed(b, kinds[kind], 417, 10));
            TEST_ASSERT_EQUAL(OKID_OK, feed(b, kinds[kind], 427, N - 427));
            same_bits(a, b);
            free(bytes);
            free(block);
            free(other);
        }
}

/// Sums are kept as they come: a unit of all channels scales them by its square, as it does the means.
static void one_unit_of_all_channels_scales_the_sums(void) {
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    const double units[] = {2, 0.5, -1, 3};
    static double plain[W * W], scaled[W * W];
    for (int kind = 0; kind < 4; ++kind)
        for (int mean = 0; mean < 2; ++mean)
            for (int k = 0; k < 4; ++k) {
                const okid_detrend_t detrend = mean ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
                void* block;
                okid_accumulator_t* a = make(config_of(kinds[kind]), &block);
                TEST_ASSERT_EQUAL(OKID_OK, feed(a, kinds[kind], 0, 60));
                double scale[M], of_ones[M], of_units[M];
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, detrend, plain, of_ones));
                for (int c = 0; c < M; ++c) scale[c] = units[k];
                okid_accumulator_set_units(a, scale, NULL);
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, detrend, scaled, of_units));
                for (int i = 0; i < W * W; ++i)
                    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * fabs(plain[i]), plain[i] * units[k] * units[k], scaled[i]);
                for (int c = 0; c < M; ++c)
                    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * fabs(of_ones[c]), of_ones[c] * units[k], of_units[c]);
                free(block);
            }
}

static void damaged_bytes_change_nothing(void) {
    void *block, *other;
    okid_accumulator_t* a = make(config_of(OKID_SAMPLE_INT16), &block);
    TEST_ASSERT_EQUAL(OKID_OK, feed(a, OKID_SAMPLE_INT16, 0, N));
    const size_t size = okid_accumulator_serialised_size(a);
    unsigned char* bytes = malloc(size);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(a, bytes, size));
    okid_accumulator_t* b = make(config_of(OKID_SAMPLE_INT16), &other);
    TEST_ASSERT_EQUAL(OKID_OK, feed(b, OKID_SAMPLE_INT16, 0, 100));
    const int64_t rows = okid_accumulator_rows(b);
    for (size_t i = 0; i < size; i += i < 100 ? 1 : 37) {
        bytes[i] ^= 0x10;
        TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, okid_accumulator_deserialise(b, bytes, size));
        bytes[i] ^= 0x10;
    }
    for (size_t cut = 0; cut < size; cut += 97)
        TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, okid_accumulator_deserialise(b, bytes, cut));
    TEST_ASSERT_EQUAL_INT64(rows, okid_accumulator_rows(b));
    okid_accumulator_config_t longer = config_of(OKID_SAMPLE_INT16);
    longer.lags += 1;
    free(other);
    b = make(longer, &other);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_deserialise(b, bytes, size));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_deserialise(b, NULL, size));
    free(bytes);
    free(block);
    free(other);
}

static char static_block[OKID_ACCUMULATOR_BYTES(RIG_NU, RIG_NY, P)];
static char static_codes[OKID_ACCUMULATOR_CODES_BYTES(RIG_NU, RIG_NY, P)];

static void constants_bound_the_memory(void) {
    for (int n_u = 0; n_u <= 4; ++n_u)
        for (int n_y = 1; n_y <= 12; ++n_y)
            for (int p = 1; p <= 64; p += 7) {
                okid_accumulator_config_t c = {n_u, n_y, p, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 0, 0, 0, 0, 1};
                const size_t size = okid_accumulator_memsize(&c), bound = OKID_ACCUMULATOR_BYTES(n_u, n_y, p);
                TEST_ASSERT_LESS_OR_EQUAL(bound, size);
                TEST_ASSERT_GREATER_THAN(bound - 160, size); // a bound, not a waste
                c.sample = OKID_SAMPLE_INT16;
                TEST_ASSERT_LESS_OR_EQUAL(OKID_ACCUMULATOR_CODES_BYTES(n_u, n_y, p), okid_accumulator_memsize(&c));
                c.sample = OKID_SAMPLE_INT24;
                TEST_ASSERT_LESS_OR_EQUAL(OKID_ACCUMULATOR_CODES_BYTES(n_u, n_y, p), okid_accumulator_memsize(&c));
            }
    okid_accumulator_t* a;
    okid_accumulator_config_t c = {RIG_NU, RIG_NY, P, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 0, 0, 0, 0, 1};
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &c, static_block, sizeof static_block));
    c.sample = OKID_SAMPLE_INT16;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &c, static_codes, sizeof static_codes));
}

/// The state of an unbroken record: at most 1.1 times S, the head and the lag window.
static void the_state_is_small(void) {
    const int sizes[3][2] = {{1, 3}, {2, 6}, {3, 10}};
    for (int k = 0; k < 3; ++k)
        for (int p = 20; p <= 40; p += 20) {
            const int n_u = sizes[k][0], n_y = sizes[k][1], m = n_u + n_y, q = n_u + p * m;
            const okid_accumulator_config_t c = {n_u, n_y, p, OKID_SAMPLE_DOUBLE, 0, 0, 1.0, 0, 0, 0, 0, 1};
            TEST_ASSERT_LESS_OR_EQUAL(1.1 * 8 * (m * (q + n_y) + 2 * p * m), (double)okid_accumulator_memsize(&c));
        }
}

static void the_buffer_changes_no_bit(void) {
    const int buffers[] = {1, 2, 31, 256, 5000}, cuts[] = {1, 6, 7, 100, N};
    okid_accumulator_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    void *block, *other;
    okid_accumulator_t* whole = make(config, &block);
    TEST_ASSERT_EQUAL(OKID_OK, feed(whole, OKID_SAMPLE_DOUBLE, 0, N));
    for (int k = 0; k < 25; ++k) {
        config.buffer = buffers[k / 5];
        okid_accumulator_t* a = make(config, &other);
        for (int n = 0; n < N; n += cuts[k % 5])
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, OKID_SAMPLE_DOUBLE, n, n + cuts[k % 5] > N ? N - n : cuts[k % 5]));
        same_bits(whole, a);
        free(other);
    }
    free(block);
}

static void single_precision_samples_sum_in_double(void) {
    void *block, *other;
    float single[N * M];
    for (int i = 0; i < N * M; ++i) samples[i] = single[i] = (float)samples[i];
    single[40 * M + 1] = NAN;
    samples[40 * M + 1] = NAN;
    okid_accumulator_t *a = make(config_of(OKID_SAMPLE_DOUBLE), &block),
                       *b = make(config_of(OKID_SAMPLE_DOUBLE), &other);
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_accumulator_add(a, samples, N));
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_accumulator_add_f32(b, single, N));
    same_bits(a, b);
    free(block);
    free(other);
}

static void saturated_samples_can_count_as_missing(void) {
    const okid_sample_t kinds[] = {OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    for (int kind = 0; kind < 3; ++kind) {
        const int32_t top = kind == 0 ? INT16_MAX : kind == 1 ? (1 << 23) - 1 : INT32_MAX;
        const int holes[] = {60, 61, 350};
        okid_accumulator_config_t config = config_of(kinds[kind]);
        void *block, *other;
        okid_accumulator_t* told = make(config, &other);
        config.saturated_missing = 1;
        okid_accumulator_t* found = make(config, &block);
        TEST_ASSERT_EQUAL(OKID_OK, feed(told, kinds[kind], 0, 60));
        okid_accumulator_gap(told, 2);
        TEST_ASSERT_EQUAL(OKID_OK, feed(told, kinds[kind], 62, 288));
        okid_accumulator_gap(told, 1);
        TEST_ASSERT_EQUAL(OKID_OK, feed(told, kinds[kind], 351, N - 351));
        for (int k = 0; k < 3; ++k) {
            words[holes[k] * M + k] = (int16_t)(k == 1 ? -top - 1 : top);
            codes[holes[k] * M + k] = k == 1 ? -top - 1 : top;
        }
        TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, feed(found, kinds[kind], 0, N));
        okid_accumulator_stats_t stats;
        okid_accumulator_stats(found, &stats);
        TEST_ASSERT_EQUAL_INT64(3, stats.saturated);
        TEST_ASSERT_EQUAL_INT64(3, stats.missing);
        double left[W * W], right[W * W];
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(told, OKID_DETREND_MEAN, left, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(found, OKID_DETREND_MEAN, right, NULL));
        TEST_ASSERT_EQUAL_MEMORY(left, right, sizeof left);
        free(block);
        free(other);
        tearDown();
        setUp();
    }
}

/// Gram matrix of rows [first + P, last) less `mean`, added to `gram`.
static void add_rows(const double* v, int first, int last, const double* mean, double* gram) {
    for (int n = first + P; n < last; ++n)
        for (int j = 0; j < W; ++j)
            for (int i = 0; i < W; ++i)
                gram[j * W + i] +=
                    (v[(n - i / M) * M + i % M] - mean[i % M]) * (v[(n - j / M) * M + j % M] - mean[j % M]);
}

/// Records whose offsets differ: each less its own mean, then merged.
static void records_are_centred_one_by_one(void) {
    static double expected[W * W], actual[W * W], first[W * W], v[N * M];
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT32};
    const int ends[] = {0, 150, 320, N}, orders[2][3] = {{0, 1, 2}, {2, 0, 1}};
    for (int kind = 0; kind < 3; ++kind) {
        for (int i = 0; i < N * M; ++i) { // an offset that moves from record to record
            const int record = i / M < ends[1] ? 0 : i / M < ends[2] ? 1 : 2;
            words[i] = (int16_t)(words[i] / 2 + 3000 * (record - 1));
            codes[i] = words[i] * 60000;
            samples[i] += 5 * record;
            v[i] = kind == 0 ? samples[i] : kind == 1 ? words[i] : codes[i];
        }
        memset(expected, 0, sizeof expected);
        for (int r = 0; r < 3; ++r) {
            double mean[M] = {0};
            for (int i = (ends[r] + P) * M; i < ends[r + 1] * M; ++i) mean[i % M] += v[i] / (ends[r + 1] - ends[r] - P);
            add_rows(v, ends[r], ends[r + 1], mean, expected);
        }
        for (int order = 0; order < 2; ++order) {
            void *block, *other;
            okid_accumulator_t* total = make(config_of(kinds[kind]), &block);
            for (int k = 0; k < 3; ++k) {
                const int r = orders[order][k];
                okid_accumulator_t* record = make(config_of(kinds[kind]), &other);
                TEST_ASSERT_EQUAL(OKID_OK, feed(record, kinds[kind], ends[r], ends[r + 1] - ends[r]));
                if (k == 1) TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_merge(total, record));
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_centre(record));
                TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, feed(record, kinds[kind], 0, 1));
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(total, record));
                free(other);
            }
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(total, OKID_DETREND_NONE, actual, NULL));
            double scale = 0;
            for (int i = 0; i < W * W; ++i) scale = fmax(scale, fabs(expected[i]));
            const double left = kind == 1 ? 2e-6 : 1e-12; // what 2^-9 of a 16-bit code may leave
            for (int i = 0; i < W * W; ++i) TEST_ASSERT_DOUBLE_WITHIN(left * scale, expected[i], actual[i]);
            if (order == 0)
                memcpy(first, actual, sizeof actual);
            else if (kind > 0)
                TEST_ASSERT_EQUAL_MEMORY(first, actual, sizeof actual);
            free(block);
        }
        tearDown();
        setUp();
    }
}

/// S, head, tail and sum of a run give the Gram matrix back.
static void one_run_is_exported(void) {
    static double S[M * W], head[P * M], tail[P * M], sum[M], mean[M], same_mean[M], gram[W * W], expected[W * W], g[W];
    okid_run_sums_t sums = {S, head, tail, sum, mean, 0};
    const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24};
    for (int k = 0; k < 12; ++k) { // kind, detrend, window
        const okid_sample_t kind = kinds[k / 4];
        const okid_detrend_t detrend = (okid_detrend_t)(k & 1);
        okid_accumulator_config_t config = config_of(kind);
        if (k & 2) config.block = 40, config.slots = 5, config.edges = 0;
        void* block;
        okid_accumulator_t* a = make(config, &block);
        okid_accumulator_set_units(a, (double[]){2, 0.5, 1, 3}, (double[]){1, 0, -1, 2});
        TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_accumulator_run(a, detrend, &sums));
        TEST_ASSERT_EQUAL(OKID_OK, feed(a, kind, 0, k & 2 ? P + 480 : N));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_run(a, detrend, &sums));
        const double rows = (double)okid_accumulator_rows(a);
        TEST_ASSERT_EQUAL(rows, sums.rows);
        for (int j = 0; j < W; ++j) {
            g[j] = j < M ? sum[j] : g[j - M] + head[j - M] - tail[j - M];
            for (int i = 0; i <= j; ++i)
                gram[j * W + i] =
                    i < M ? S[j * M + i]
                          : gram[(j - M) * W + i - M] + head[i - M] * head[j - M] - tail[i - M] * tail[j - M];
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, detrend, expected, same_mean));
        for (int r = 0; r < M; ++r) TEST_ASSERT_DOUBLE_WITHIN(1e-13 * fabs(mean[r]), same_mean[r], mean[r]);
        double scale = 0;
        for (int i = 0; i < W * W; ++i) scale = fmax(scale, fabs(expected[i]));
        for (int j = 0; j < W; ++j)
            for (int i = 0; i <= j; ++i)
                TEST_ASSERT_DOUBLE_WITHIN(1e-13 * scale, expected[j * W + i],
                                          gram[j * W + i] - (detrend ? g[i] * g[j] / rows : 0));
        okid_accumulator_gap(a, 1);
        TEST_ASSERT_EQUAL(OKID_OK, feed(a, kind, 0, 100));
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_run(a, detrend, &sums));
        free(block);
    }
}

static uint32_t crc32_of(const uint8_t* at, size_t count) {
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i < count; ++i) {
        crc ^= at[i];
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xEDB88320 : 0);
    }
    return ~crc;
}

/// 8 bytes at a place replaced, with the checksum that belongs to them.
static okid_status_t with_bits(okid_accumulator_t* a, const uint8_t* good, size_t bytes, size_t at, uint64_t bits) {
    uint8_t* changed = malloc(bytes);
    memcpy(changed, good, bytes);
    for (int i = 0; i < 8; ++i) changed[at + (size_t)i] = (uint8_t)(bits >> 8 * i);
    const uint32_t crc = crc32_of(changed, bytes - 4);
    for (int i = 0; i < 4; ++i) changed[bytes - 4 + (size_t)i] = (uint8_t)(crc >> 8 * i);
    const okid_status_t status = okid_accumulator_deserialise(a, changed, bytes);
    free(changed);
    return status;
}

/// A checksum that is right says nothing of the numbers: not finite, negative counts, no square above 0.
static void absurd_content_is_refused(void) {
    const uint64_t infinite = 0x7FF0000000000000, nan = 0x7FF8000000000001, negative = 0xBFF0000000000000;
    okid_accumulator_config_t config = okid_accumulator_defaults(1, 1, 2);
    config.edges = 1;
    const size_t size = okid_accumulator_memsize(&config);
    void* block = malloc(size);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, block, size));
    const double values[] = {1, 2, 3, 5, -1, 2, 4, 1, 0, 3, 2, 2, 7, 1, 1, 1};
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, values, 8));
    const size_t bytes = okid_accumulator_serialised_size(a);
    uint8_t* good = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(a, good, bytes));
    const size_t header = 8 + 4 * 10 + 8, stats = sizeof(okid_accumulator_stats_t), scale = header + stats + 16 + 16;
    const size_t x = scale + 8 * 4, slot = x + 8 * 4, sums = slot + 24;
    TEST_ASSERT_EQUAL(OKID_OK, with_bits(a, good, bytes, slot + 8, 0));
    for (size_t at = header; at < header + stats + 8; at += 8) // counts and clock
        TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, at, negative));
    for (size_t at = scale; at + 8 < bytes; at += 8)
        if (at < slot || at >= sums) {
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, at, infinite));
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, at, nan));
        }
    TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, slot, negative)); // rows
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(a, good, bytes));
    TEST_ASSERT_EQUAL_INT64(6, okid_accumulator_rows(a)); // nothing was changed by what was refused
    uint8_t* none = malloc(bytes);
    memcpy(none, good, bytes);
    for (int i = 0; i < 8; ++i)
        none[sums + 8 * 4 + (size_t)i] = (uint8_t)(negative >> 8 * i); // the square of channel 0
    TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, none, bytes, sums + 8 * (6 + 5), negative)); // and of channel 1
    free(none);
    free(good);
    free(block);
}

/// Found by tests/fuzz/fuzz_state.cpp: sums of codes that no codes have, and a base where there is no room for one.
static void sums_that_overflow_and_a_base_of_a_window(void) {
    okid_accumulator_config_t config = okid_accumulator_defaults(1, 1, 1);
    config.sample = OKID_SAMPLE_INT16;
    config.edges = 1;
    const int16_t five[] = {1, 2, 3, 4, -5, 6, 7, -8, 9, 10};
    const double values[] = {1, 2, 3, 4, -5, 6, 7, -8, 9, 10};
    const size_t header = 8 + 4 * 10 + 8, weight = header + sizeof(okid_accumulator_stats_t) + 8;
    const size_t sums = weight + 8 + 16 + 8 * 4 + 4 * 2 + 24, products = 8; // of a plane
    for (int window = 0; window < 2; ++window) {
        if (window) config = okid_accumulator_defaults(1, 1, 1), config.block = 2, config.slots = 2;
        const size_t size = okid_accumulator_memsize(&config);
        void* block = malloc(size);
        okid_accumulator_t* a = NULL;
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &config, block, size));
        TEST_ASSERT_EQUAL(OKID_OK, window ? okid_accumulator_add(a, values, 5) : okid_accumulator_add_i16(a, five, 5));
        const size_t bytes = okid_accumulator_serialised_size(a);
        uint8_t* good = malloc(bytes);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(a, good, bytes));
        if (window) {
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, weight, 0x3FF0000000000000));
        } else {
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, sums, UINT64_C(1) << 48));        // low word
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, with_bits(a, good, bytes, sums + 8 * products, INT64_MAX)); // high word
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT,
                              with_bits(a, good, bytes, sums + 16 * products, UINT64_C(1) << 60)); // sum
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(a, good, bytes));
        free(good);
        free(block);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(sums_that_overflow_and_a_base_of_a_window);
    RUN_TEST(absurd_content_is_refused);
    RUN_TEST(bytes_go_on_bit_for_bit);
    RUN_TEST(one_unit_of_all_channels_scales_the_sums);
    RUN_TEST(damaged_bytes_change_nothing);
    RUN_TEST(constants_bound_the_memory);
    RUN_TEST(the_state_is_small);
    RUN_TEST(the_buffer_changes_no_bit);
    RUN_TEST(single_precision_samples_sum_in_double);
    RUN_TEST(saturated_samples_can_count_as_missing);
    RUN_TEST(records_are_centred_one_by_one);
    RUN_TEST(one_run_is_exported);
    return UNITY_END();
}
