// SPDX-License-Identifier: MIT
// Correlation sums against the sums written out over the samples: lags, ends, gaps, windows, forgetting, offsets, merging, bytes.
#include "accumulate/correlation.h"
#include "modal_rig.h"

#include <okid/okid.h>
#include <stdio.h>
#include <unity.h>

enum { N_U = 2, N_Y = 3, M = N_U + N_Y, L = 37, OWN = 5, N = 1200, MOST_RUNS = 8 };
static const double scale[M] = {2, 0.5, 3, 1, 0.25};
static int32_t words[N * M];
static int16_t codes[N * M];
static double samples[N * M];

/// A run of the record, its rows and their weight.
typedef struct piece_t {
    int first, count;
    double weight;
} piece_t;

void setUp(void) {
    uint64_t state = 9;
    for (int i = 0; i < N * M; ++i) {
        codes[i] = (int16_t)lrint(20000 + 3000 * rig_normal(&state)); // mid-scale of a converter without a sign
        words[i] = codes[i] * 97;
        samples[i] = codes[i];
    }
}
void tearDown(void) {}

static okid_correlation_config_t config_of(okid_sample_t sample) {
    okid_correlation_config_t config = okid_correlation_defaults(N_U, N_Y, L);
    config.own_lags = OWN;
    config.sample = sample;
    config.slots = MOST_RUNS;
    return config;
}

static okid_correlation_t* make(okid_correlation_config_t config, void** block) {
    const size_t bytes = okid_correlation_memsize(&config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    *block = malloc(bytes);
    okid_correlation_t* self = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&self, &config, *block, bytes));
    okid_correlation_set_units(self, scale);
    return self;
}

static okid_status_t feed(okid_correlation_t* self, int first, int count) {
    okid_correlation_config_t config;
    okid_correlation_config(self, &config);
    const size_t at = (size_t)(first * M), n = (size_t)count;
    if (config.sample == OKID_SAMPLE_DOUBLE) return okid_correlation_add(self, samples + at, n);
    if (config.sample == OKID_SAMPLE_INT16) return okid_correlation_add_i16(self, codes + at, n);
    return okid_correlation_add_i32(self, words + at, n);
}

static double value(okid_sample_t sample, const double* centre, int n, int c) {
    const double x =
        sample == OKID_SAMPLE_DOUBLE || sample == OKID_SAMPLE_INT16 ? samples[n * M + c] : words[n * M + c];
    return scale[c] * (x - (centre ? centre[c] : 0));
}

static void close_to(double expected, double got, double size, const char* what) {
    if (fabs(expected - got) <= 1e-13 * size) return;
    char text[120];
    snprintf(text, sizeof text, "%s: expected %.17g, got %.17g", what, expected, got);
    TEST_FAIL_MESSAGE(text);
}

/// Everything of okid_correlation_sums() against plain sums over the pieces (rows first + L .. first + count - 1).
static void expect_sums(okid_correlation_t* self, const piece_t* pieces, int count, okid_detrend_t detrend) {
    okid_correlation_config_t config;
    okid_correlation_config(self, &config);
    const okid_sample_t kind = config.sample;
    const size_t bytes = okid_correlation_sums_memsize(self);
    void* block = malloc(bytes);
    okid_correlation_sums_t got;
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_correlation_sums(self, detrend, &got, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(self, detrend, &got, block, bytes));
    double rows = 0, mean[M] = {0};
    for (int k = 0; k < count; ++k) rows += pieces[k].weight * (pieces[k].count - L);
    for (int k = 0; k < count; ++k)
        for (int n = pieces[k].first + L; n < pieces[k].first + pieces[k].count; ++n)
            for (int c = 0; c < M; ++c) mean[c] += pieces[k].weight * value(kind, NULL, n, c) / scale[c] / rows;
    for (int c = 0; c < M; ++c) {
        if (detrend == OKID_DETREND_NONE) mean[c] = 0;
        if (kind != OKID_SAMPLE_DOUBLE) mean[c] = floor(mean[c] + 0.5);
    }
    close_to(rows, got.rows, rows, "rows");
    TEST_ASSERT_EQUAL(count, got.runs);
    for (int r = 0; r < M; ++r)
        for (int d = 0; d <= L; ++d)
            for (int c = 0; c < M; ++c) {
                if (c >= N_U && d > OWN) continue;
                double sum = 0, plain = 0, lag = 0, size = 0;
                for (int k = 0; k < count; ++k)
                    for (int n = pieces[k].first + L; n < pieces[k].first + pieces[k].count; ++n) {
                        const double v = value(kind, mean, n, r), u = value(kind, mean, n - d, c), w = pieces[k].weight;
                        sum += w * v * u;
                        plain += w * v;
                        lag += w * u;
                        size += w * fabs(value(kind, NULL, n, r) * value(kind, NULL, n - d, c));
                    }
                close_to(sum, c < N_U ? got.U[(d * N_U + c) * M + r] : got.Y[(d * N_Y + c - N_U) * M + r], size,
                         "products");
                close_to(plain, got.sum[r], size, "sum");
                if (c < N_U) close_to(lag, got.lag_sum[d * N_U + c], size, "lag sum");
                if (c >= N_U || r >= N_U) continue;
                double oldest = 0;
                for (int k = 0; k < count; ++k)
                    for (int n = pieces[k].first + L; n < pieces[k].first + pieces[k].count; ++n)
                        oldest += pieces[k].weight * value(kind, mean, n - L, r) * value(kind, mean, n - d, c);
                close_to(oldest, got.T[(d * N_U + c) * N_U + r], size, "products with the oldest");
            }
    for (int k = 0; k < count; ++k) {
        close_to(pieces[k].weight, got.weight[k], 1, "weight");
        for (int a = 0; a < L; ++a)
            for (int c = 0; c < N_U; ++c) {
                const double* head = got.ends + 2 * k * N_U * L;
                close_to(value(kind, mean, pieces[k].first + L - 1 - a, c), head[a * N_U + c], 1e6, "head");
                close_to(value(kind, mean, pieces[k].first + pieces[k].count - 1 - a, c), head[(L + a) * N_U + c], 1e6,
                         "tail");
            }
    }
    free(block);
}

static const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};

static void one_run_in_any_cut(void) {
    for (int kind = 0; kind < 4; ++kind)
        for (int buffer = 0; buffer < 2; ++buffer) {
            okid_correlation_config_t config = config_of(kinds[kind]);
            config.buffer = buffer;
            void* block;
            okid_correlation_t* self = make(config, &block);
            for (int n = 0, step = 1; n < N; n += step, step = step % 97 + 1) {
                if (step > N - n) step = N - n;
                TEST_ASSERT_EQUAL(OKID_OK, feed(self, n, step));
            }
            const piece_t all = {0, N, 1};
            expect_sums(self, &all, 1, OKID_DETREND_NONE);
            expect_sums(self, &all, 1, OKID_DETREND_MEAN);
            free(block);
        }
}

static void gaps_re_arm_and_are_counted(void) {
    const piece_t runs[] = {{0, 300, 1}, {310, 290, 1}, {640, 560, 1}};
    for (int kind = 0; kind < 4; ++kind) {
        void* block;
        okid_correlation_t* self = make(config_of(kinds[kind]), &block);
        TEST_ASSERT_EQUAL(OKID_OK, feed(self, 0, 300));
        okid_correlation_gap(self, 10);
        TEST_ASSERT_EQUAL(OKID_OK, feed(self, 310, 290));
        okid_correlation_gap(self, 15);
        TEST_ASSERT_EQUAL(OKID_OK, feed(self, 615, 20)); // shorter than L: no rows
        okid_correlation_gap(self, 5);
        TEST_ASSERT_EQUAL(OKID_OK, feed(self, 640, 560));
        expect_sums(self, runs, 3, OKID_DETREND_MEAN);
        okid_accumulator_stats_t stats;
        okid_correlation_stats(self, &stats);
        TEST_ASSERT_EQUAL_INT64(1170, stats.samples);
        TEST_ASSERT_EQUAL_INT64(30, stats.missing);
        TEST_ASSERT_EQUAL_INT64(3, stats.gaps);
        TEST_ASSERT_EQUAL_INT64(300 + 290 + 560 - 3 * L, stats.rows);
        free(block);
    }
}

static void a_nan_is_a_gap_and_what_has_no_slot_is_counted(void) {
    okid_correlation_config_t config = config_of(OKID_SAMPLE_DOUBLE);
    config.slots = 1;
    void* block;
    okid_correlation_t* self = make(config, &block);
    samples[500 * M + 3] = NAN;
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, feed(self, 0, N));
    const piece_t first = {0, 500, 1};
    expect_sums(self, &first, 1, OKID_DETREND_NONE);
    okid_accumulator_stats_t stats;
    okid_correlation_stats(self, &stats);
    TEST_ASSERT_EQUAL_INT64(N - 501, stats.dropped);
    TEST_ASSERT_EQUAL_INT64(500 - L, stats.rows);
    free(block);
}

static void a_window_forgets_and_fades(void) {
    enum { BLOCK = 64, SLOTS = 4 };
    for (int kind = 0; kind < 4; ++kind)
        for (int fading = 0; fading < 2; ++fading) {
            okid_correlation_config_t config = config_of(kinds[kind]);
            config.block = BLOCK;
            config.slots = SLOTS;
            config.forgetting = fading ? 0.99 : 1;
            void* block;
            okid_correlation_t* self = make(config, &block);
            const int end = L + 9 * BLOCK + 10;
            TEST_ASSERT_EQUAL(OKID_OK, feed(self, 0, end));
            piece_t slots[SLOTS + 1]; // 4 closed ones and the open one with 10 rows
            for (int k = 0; k <= SLOTS; ++k) {
                const int newer = k == SLOTS ? 0 : 10 + (SLOTS - 1 - k) * BLOCK;
                slots[k] = (piece_t){(5 + k) * BLOCK, L + (k < SLOTS ? BLOCK : 10), pow(config.forgetting, newer)};
            }
            expect_sums(self, slots, SLOTS + 1, OKID_DETREND_MEAN);
            expect_sums(self, slots, SLOTS + 1, OKID_DETREND_NONE);
            free(block);
        }
}

/// Bytes of the same state: the sums in them are compared, not what a reader makes of them.
static void* bytes_of(okid_correlation_t* self, size_t* size) {
    *size = okid_correlation_serialised_size(self);
    void* bytes = malloc(*size);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_correlation_serialise(self, bytes, *size - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_serialise(self, bytes, *size));
    return bytes;
}

static void merged_is_batch(void) {
    for (int kind = 0; kind < 4; ++kind) {
        void *one, *two, *all;
        okid_correlation_t* a = make(config_of(kinds[kind]), &one);
        okid_correlation_t* b = make(config_of(kinds[kind]), &two);
        okid_correlation_t* whole = make(config_of(kinds[kind]), &all);
        TEST_ASSERT_EQUAL(OKID_OK, feed(a, 0, 500));
        TEST_ASSERT_EQUAL(OKID_OK, feed(b, 500, 700));
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_merge(a, b));
        TEST_ASSERT_EQUAL(OKID_OK, feed(whole, 0, 500));
        okid_correlation_gap(whole, 0);
        TEST_ASSERT_EQUAL(OKID_OK, feed(whole, 500, 700));
        okid_correlation_gap(whole, 0);
        const piece_t runs[] = {{0, 500, 1}, {500, 700, 1}};
        expect_sums(a, runs, 2, OKID_DETREND_MEAN);
        okid_correlation_sums_t left, right;
        const size_t size = okid_correlation_sums_memsize(a);
        double *x = malloc(size), *y = malloc(size);
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(a, OKID_DETREND_NONE, &left, x, size));
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(whole, OKID_DETREND_NONE, &right, y, size));
        for (int i = 0; i < M * N_U * (L + 1); ++i) { // codes: the same bits
            if (kinds[kind] != OKID_SAMPLE_DOUBLE)
                TEST_ASSERT_EQUAL_MEMORY(left.U + i, right.U + i, sizeof *left.U);
            else
                close_to(right.U[i], left.U[i], fabs(right.U[i]), "merged");
        }
        free(x);
        free(y);
        free(one);
        free(two);
        free(all);
    }
}

static void bytes_go_on_bit_for_bit(void) {
    for (int kind = 0; kind < 4; ++kind)
        for (int window = 0; window < 2; ++window) {
            okid_correlation_config_t config = config_of(kinds[kind]), found;
            config.block = window ? 64 : 0;
            void *one, *two;
            okid_correlation_t* a = make(config, &one);
            okid_correlation_t* b = make(config, &two);
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, 0, 400));
            okid_correlation_gap(a, 3);
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, 403, 300));
            size_t size, again;
            uint8_t* bytes = bytes_of(a, &size);
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_peek(bytes, size, &found));
            TEST_ASSERT_EQUAL(config.block, found.block);
            TEST_ASSERT_EQUAL(config.sample, found.sample);
            TEST_ASSERT_EQUAL(OKID_OK, feed(b, 0, 100)); // what was there goes
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_deserialise(b, bytes, size));
            TEST_ASSERT_EQUAL(OKID_OK, feed(a, 703, 497));
            TEST_ASSERT_EQUAL(OKID_OK, feed(b, 703, 497));
            uint8_t *left = bytes_of(a, &size), *right = bytes_of(b, &again);
            TEST_ASSERT_EQUAL(size, again);
            TEST_ASSERT_EQUAL_MEMORY(left, right, size);
            left[size / 2] ^= 1;
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, okid_correlation_deserialise(b, left, size));
            TEST_ASSERT_EQUAL(OKID_ERR_FORMAT, okid_correlation_peek(left, 20, &found));
            free(left);
            left = bytes_of(b, &again); // an error has changed nothing
            TEST_ASSERT_EQUAL_MEMORY(left, right, size);
            config.lags = L + 1;
            void* three;
            TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_deserialise(make(config, &three), right, size));
            free(three);
            free(bytes);
            free(left);
            free(right);
            free(one);
            free(two);
        }
}

#ifdef OKID_INTEGER_KERNEL
enum { TRANSFORMS = 0 }; // a microcontroller sums directly
#else
enum { TRANSFORMS = 1 };
#endif

/// A look at the sums, which leaves no trace.
static void look(okid_correlation_t* self) {
    okid_correlation_sums_t got;
    const size_t size = okid_correlation_sums_memsize(self);
    void* room = malloc(size);
    TEST_ASSERT_GREATER_OR_EQUAL(0, (okid_correlation_sums(self, OKID_DETREND_MEAN, &got, room, size) + 99));
    free(room);
}

static void expect_same_bytes(okid_correlation_t* a, okid_correlation_t* b) {
    size_t size, again;
    uint8_t *left = bytes_of(a, &size), *right = bytes_of(b, &again);
    TEST_ASSERT_EQUAL(size, again);
    TEST_ASSERT_EQUAL_MEMORY(left, right, size);
    free(left);
    free(right);
}

/// So many lags that transforms sum (buffer = 0) beside the direct kernel: the same integers, and doubles to rounding; looks in
/// between and gaps change nothing.
static void transforms_sum_what_the_kernel_sums(void) {
    enum { LAGS = 300 };
    for (int kind = 0; kind < 2; ++kind)
        for (int window = 0; window < 2; ++window) {
            okid_correlation_config_t config = config_of(kind ? OKID_SAMPLE_DOUBLE : OKID_SAMPLE_INT16);
            config.lags = LAGS;
            config.block = window ? 600 : 0;
            void *one, *two, *three;
            okid_correlation_t *fast = make(config, &one), *looked_at = make(config, &two);
            TEST_ASSERT_EQUAL(TRANSFORMS, fast->points > 256);
            config.buffer = 64;
            okid_correlation_t* direct = make(config, &three);
            TEST_ASSERT_EQUAL(0, direct->points);
            const int cuts[] = {0, 7, 190, 633, 640, N};
            for (int k = 0; k < 5; ++k) {
                TEST_ASSERT_EQUAL(OKID_OK, feed(fast, cuts[k], cuts[k + 1] - cuts[k]));
                TEST_ASSERT_EQUAL(OKID_OK, feed(looked_at, cuts[k], cuts[k + 1] - cuts[k]));
                TEST_ASSERT_EQUAL(OKID_OK, feed(direct, cuts[k], cuts[k + 1] - cuts[k]));
                look(looked_at);
                if (k != 2 || kind) continue;
                okid_correlation_gap(fast, 3);
                okid_correlation_gap(looked_at, 3);
                okid_correlation_gap(direct, 3);
            }
            expect_same_bytes(fast, looked_at);
            if (!kind) expect_same_bytes(fast, direct);
            okid_correlation_sums_t got, wanted;
            const size_t size = okid_correlation_sums_memsize(fast);
            void *x = malloc(size), *y = malloc(size);
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(fast, OKID_DETREND_NONE, &got, x, size));
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(direct, OKID_DETREND_NONE, &wanted, y, size));
            for (int i = 0; i < M * N_U * (LAGS + 1); ++i)
                close_to(wanted.U[i], got.U[i], 100 * fabs(wanted.U[i]), "transforms, U");
            for (int i = 0; i < N_U * N_U * (LAGS + 1); ++i)
                close_to(wanted.T[i], got.T[i], 100 * fabs(wanted.T[i]), "transforms, T");
            free(x);
            free(y);
            free(one);
            free(two);
            free(three);
        }
}

/// Codes at full scale: too loud for a transform of so many points, or for many of them together.
static void loud_codes_stay_exact(void) {
    enum { COUNT = 9000 };
    int16_t* loud = malloc(sizeof *loud * 2 * COUNT);
    uint64_t state = 3;
    for (int i = 0; i < 2 * COUNT; ++i) loud[i] = rig_normal(&state) > 0 ? 32767 : -32768;
    const int32_t lags[] = {100, 4000};
    for (int k = 0; k < 2; ++k) {
        okid_correlation_config_t config = okid_correlation_defaults(1, 1, lags[k]);
        config.sample = OKID_SAMPLE_INT16;
        okid_correlation_t* made[2];
        void* blocks[2];
        for (int direct = 0; direct < 2; ++direct) {
            config.buffer = direct;
            const size_t bytes = okid_correlation_memsize(&config);
            blocks[direct] = malloc(bytes);
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&made[direct], &config, blocks[direct], bytes));
            TEST_ASSERT_EQUAL(TRANSFORMS && direct == 0, made[direct]->points > 0);
            TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_correlation_add_i16(made[direct], loud, COUNT));
        }
        expect_same_bytes(made[0], made[1]);
        free(blocks[0]);
        free(blocks[1]);
    }
    free(loud);
}

static void full_scale_24_bit_codes_stay_exact(void) {
    enum { COUNT = 70000 }; // beyond the rows between two folds
    okid_correlation_config_t config = okid_correlation_defaults(1, 1, 2);
    config.sample = OKID_SAMPLE_INT24;
    const size_t bytes = okid_correlation_memsize(&config);
    void* block = malloc(bytes);
    okid_correlation_t* self = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&self, &config, block, bytes));
    int32_t* full = malloc(sizeof *full * 2 * COUNT);
    for (int i = 0; i < 2 * COUNT; ++i) full[i] = -(1 << 23);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_correlation_add_i32(self, full, COUNT));
    full[0] = 1 << 23;
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_correlation_add_i32(self, full, 1));
    okid_correlation_sums_t got;
    const size_t room = okid_correlation_sums_memsize(self);
    void* sums = malloc(room);
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(self, OKID_DETREND_NONE, &got, sums, room));
    for (int i = 0; i < 6; ++i) TEST_ASSERT_TRUE(got.U[i] == (COUNT - 2) * 0x1p46);
    free(sums);
    free(full);
    free(block);
}

static void wrong_use_is_refused(void) {
    const okid_correlation_config_t good = config_of(OKID_SAMPLE_INT16);
    const int64_t places[] = {0, 1, 2, 3, 4, 5, 6}; // n_u, n_y, lags, own_lags, sample, block, slots
    const int32_t bad[] = {0, 0, 0, L + 1, 4, -1, 0};
    void *block, *other;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
        okid_correlation_config_t config = good;
        memcpy((int32_t*)&config + places[i], &bad[i], sizeof *bad);
        TEST_ASSERT_EQUAL(0, okid_correlation_memsize(&config));
    }
    okid_correlation_config_t config = good;
    config.forgetting = 0.9; // needs a block
    TEST_ASSERT_EQUAL(0, okid_correlation_memsize(&config));
    TEST_ASSERT_EQUAL(0, okid_correlation_memsize(NULL));
    okid_correlation_t* self = make(good, &block);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_add(self, samples, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_add_i32(self, words, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_correlation_add_i16(self, NULL, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_merge(self, self));
    okid_correlation_t* doubles = make(config_of(OKID_SAMPLE_DOUBLE), &other);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_correlation_merge(self, doubles));
    double room[4096];
    okid_correlation_sums_t got;
    TEST_ASSERT_TRUE(okid_correlation_sums_memsize(self) <= sizeof room);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_correlation_sums(self, OKID_DETREND_NONE, &got, room, sizeof room));
    okid_correlation_config_t small = good;
    small.slots = 1;
    void *first, *second;
    okid_correlation_t *a = make(small, &first), *b = make(small, &second);
    TEST_ASSERT_EQUAL(OKID_OK, feed(a, 0, 100));
    TEST_ASSERT_EQUAL(OKID_OK, feed(b, 0, 100));
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_correlation_merge(a, b)); // no room for a second run
    free(first);
    free(second);
    free(block);
    free(other);
}

static void constants_bound_the_memory(void) {
    for (int n_u = 1; n_u < 5; ++n_u)
        for (int n_y = 1; n_y < 9; n_y += 2)
            for (int lags = 1; lags < 3000; lags = 3 * lags + 1)
                for (int sample = 0; sample < 4; ++sample) {
                    okid_correlation_config_t config = okid_correlation_defaults(n_u, n_y, lags);
                    config.sample = (okid_sample_t)sample;
                    config.slots = n_u;
                    config.buffer = n_y;
                    const size_t needed = okid_correlation_memsize(&config);
                    const size_t bound = OKID_CORRELATION_BYTES(n_u, n_y, lags, n_u, n_y);
                    TEST_ASSERT_TRUE(needed > 0 && needed <= bound);
                    TEST_ASSERT_TRUE(sample == 0 || bound - needed < 400);
                }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(one_run_in_any_cut);
    RUN_TEST(gaps_re_arm_and_are_counted);
    RUN_TEST(a_nan_is_a_gap_and_what_has_no_slot_is_counted);
    RUN_TEST(a_window_forgets_and_fades);
    RUN_TEST(merged_is_batch);
    RUN_TEST(bytes_go_on_bit_for_bit);
    RUN_TEST(transforms_sum_what_the_kernel_sums);
    RUN_TEST(loud_codes_stay_exact);
    RUN_TEST(full_scale_24_bit_codes_stay_exact);
    RUN_TEST(constants_bound_the_memory);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
