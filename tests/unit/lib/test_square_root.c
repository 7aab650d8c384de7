// SPDX-License-Identifier: MIT
// The square-root accumulator against explicit rows and against the other kernel; its least squares against the truth.
#include "modal_rig.h"

#include <float.h>
#include <okid/okid.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { P = 10, N = 3000, Q = RIG_NU + P * RIG_M, W = RIG_M * (P + 1), LAST = 60 };

static const double eps = sizeof(okid_real_t) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON;

static rig_t rig;
static double *samples, gram[W * W], other[W * W], expected[W * W], mean[RIG_M], other_mean[RIG_M];
static okid_real_t factor[W * W], again[W * W], theta[RIG_NY * Q], innovation[RIG_NY * RIG_NY];
static okid_real_t markov[(LAST + 1) * RIG_NY], gain[LAST * RIG_NY * RIG_NY];
static okid_observer_info_t info;
static void* blocks[4];
static int used;

void setUp(void) {
    rig_make(&rig);
    samples = rig_record(&rig, N, 0.01, NULL, 1);
    used = 0;
}

void tearDown(void) {
    free(samples);
    while (used > 0) free(blocks[--used]);
}

static const okid_square_root_config_t plain = {
    .n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .batch = 0, .block = 0, .slots = 0, .spare_slots = 0, .forgetting = 1};

static okid_square_root_t* make(okid_square_root_config_t config) {
    const size_t bytes = okid_square_root_memsize(&config);
    TEST_ASSERT_GREATER_THAN(0, bytes);
    void* block = blocks[used++] = malloc(bytes);
    okid_square_root_t* r = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&r, &config, block, bytes));
    return r;
}

static okid_square_root_t* filled(const double* v, int count) {
    okid_square_root_t* r = make(plain);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r, v, (size_t)count));
    return r;
}

static double largest(const double* x, int count) {
    double most = 0;
    for (int i = 0; i < count; ++i) most = fmax(most, fabs(x[i]));
    return most;
}

static void same(const double* left, const double* right, int count, double tolerance) {
    const double scale = largest(left, count);
    for (int i = 0; i < count; ++i) TEST_ASSERT_DOUBLE_WITHIN(tolerance * scale, left[i], right[i]);
}

/// Sum of w w^T over the rows whose whole window is finite, w = [v_n; ..; v_(n-p)]; centred when asked.
static void explicit_gram(const double* v, int count, int centre, double* out) {
    double sum[W] = {0};
    int rows = 0;
    memset(out, 0, sizeof *out * W * W);
    for (int n = P; n < count; ++n) {
        double w[W];
        int whole = 1;
        for (int i = 0; i < W; ++i) {
            w[i] = v[(n - i / RIG_M) * RIG_M + i % RIG_M];
            whole = whole && fabs(w[i]) < 1e6;
        }
        if (!whole) continue;
        ++rows;
        for (int j = 0; j < W; ++j) {
            sum[j] += w[j];
            for (int i = 0; i < W; ++i) out[j * W + i] += w[i] * w[j];
        }
    }
    for (int j = 0; centre && j < W; ++j)
        for (int i = 0; i < W; ++i) out[j * W + i] -= sum[i] * sum[j] / rows;
}

static void gram_equals_explicit_rows(void) {
    okid_square_root_t* r = filled(samples, N);
    for (int centre = 0; centre < 2; ++centre) {
        explicit_gram(samples, N, centre, expected);
        const okid_detrend_t detrend = centre ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, detrend, gram, mean));
        same(expected, gram, W * W, 100 * eps);
        for (int c = 0; c < RIG_M; ++c) {
            double sum = 0;
            for (int n = P; n < N; ++n) sum += samples[n * RIG_M + c];
            TEST_ASSERT_DOUBLE_WITHIN(100 * eps, sum / (N - P), mean[c]);
        }
    }
    TEST_ASSERT_EQUAL_INT64(N - P, okid_square_root_rows(r));
}

/// R^T R is the Gram matrix in the order [u_n, v_(n-1), .., v_(n-p), y_n], R upper triangular with a positive diagonal.
static void factor_is_a_root_of_the_gram_matrix(void) {
    okid_square_root_t* r = filled(samples, N);
    for (int centre = 0; centre < 2; ++centre) {
        const okid_detrend_t detrend = centre ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, detrend, gram, mean));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(r, detrend, factor, other_mean));
        TEST_ASSERT_EQUAL_MEMORY(mean, other_mean, sizeof mean);
        for (int j = 0; j < W; ++j)
            for (int i = 0; i < W; ++i) {
                const int row = i < RIG_NU ? i : i < Q ? i + RIG_NY : i - Q + RIG_NU;
                const int col = j < RIG_NU ? j : j < Q ? j + RIG_NY : j - Q + RIG_NU;
                double sum = 0;
                for (int k = 0; k < W; ++k) sum += (double)factor[i * W + k] * (double)factor[j * W + k];
                other[col * W + row] = sum;
                TEST_ASSERT_TRUE(i > j ? factor[j * W + i] == 0 : i < j || factor[j * W + i] > 0);
            }
        same(gram, other, W * W, 20 * eps);
    }
}

static void any_split_gives_the_same_bits(void) {
    samples[100 * RIG_M + 1] = NAN;
    for (int batch = 0; batch < 100; batch += 33) {
        okid_square_root_config_t config = plain;
        config.batch = batch;
        okid_square_root_t *a = make(config), *b = make(config);
        TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_square_root_add(a, samples, 1000));
        uint64_t state = 7;
        for (int n = 0, step = 0; n < 1000; n += step) {
            step = (int)(rig_uniform(&state) * 60);
            if (step > 1000 - n) step = 1000 - n;
            const double* from = samples + n * RIG_M;
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_square_root_add(b, from, (size_t)step));
        }
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(a, OKID_DETREND_NONE, factor, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(b, OKID_DETREND_NONE, again, NULL));
        TEST_ASSERT_EQUAL_MEMORY(factor, again, sizeof factor);
        while (used > 0) free(blocks[--used]);
    }
}

static void all_kinds_of_numbers_give_the_same_bits(void) {
    enum { COUNT = 500 };
    double real[COUNT * RIG_M];
    float single[COUNT * RIG_M];
    int16_t words[COUNT * RIG_M];
    int32_t longs[COUNT * RIG_M];
    for (int i = 0; i < COUNT * RIG_M; ++i) {
        words[i] = (int16_t)lrint(samples[i] * 500);
        real[i] = single[i] = longs[i] = words[i];
    }
    okid_square_root_t *a = filled(real, COUNT), *b = make(plain), *c = make(plain), *d = make(plain);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_f32(b, single, COUNT));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_i16(c, words, COUNT));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_i32(d, longs, COUNT));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(a, OKID_DETREND_MEAN, factor, NULL));
    okid_square_root_t* same_as[] = {b, c, d};
    for (int k = 0; k < 3; ++k) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(same_as[k], OKID_DETREND_MEAN, again, NULL));
        TEST_ASSERT_EQUAL_MEMORY(factor, again, sizeof factor);
    }
    words[8] = INT16_MIN;
    longs[9] = INT32_MAX;
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_square_root_add_i16(c, words, 10));
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_square_root_add_i32(d, longs, 10));
    okid_accumulator_stats_t stats;
    okid_square_root_stats(d, &stats);
    TEST_ASSERT_EQUAL_INT64(1, stats.saturated);
    TEST_ASSERT_EQUAL_INT64(COUNT + 10, stats.samples);
}

static void bad_samples_never_poison(void) {
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e200};
    for (int k = 0; k < 4; ++k) samples[(200 + 40 * k) * RIG_M + k] = bad[k];
    samples[241 * RIG_M] = NAN; // the same gap
    okid_square_root_t* r = make(plain);
    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, okid_square_root_add(r, samples, N));
    okid_accumulator_stats_t stats;
    okid_square_root_stats(r, &stats);
    TEST_ASSERT_EQUAL_INT64(5, stats.missing);
    TEST_ASSERT_EQUAL_INT64(4, stats.gaps);
    TEST_ASSERT_EQUAL_INT64(N - 5, stats.samples);
    TEST_ASSERT_EQUAL_INT64(N - 5 - 5 * P, stats.rows);
    TEST_ASSERT_EQUAL_INT64(0, stats.dropped);
    explicit_gram(samples, N, 0, expected);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, OKID_DETREND_NONE, gram, NULL));
    same(expected, gram, W * W, 100 * eps);
}

static void merging_stacks_records(void) {
    double gap[N * RIG_M];
    memcpy(gap, samples, sizeof gap);
    for (int n = 1000; n < N; ++n) gap[n * RIG_M + 2] += 50; // another reference
    okid_square_root_t *a = filled(gap, 1000), *b = filled(gap + 1001 * RIG_M, N - 1001), *none = make(plain);
    gap[1000 * RIG_M] = NAN;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_merge(none, b)); // takes the reference over
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_merge(none, a));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_merge(a, b));
    TEST_ASSERT_EQUAL_INT64(N - 1 - 2 * P, okid_square_root_rows(a));
    for (int centre = 0; centre < 2; ++centre) {
        const okid_detrend_t detrend = centre ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
        explicit_gram(gap, N, centre, expected);
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(a, detrend, gram, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(none, detrend, other, NULL));
        same(expected, gram, W * W, 200 * eps);
        same(expected, other, W * W, 200 * eps);
    }
    okid_square_root_config_t config = plain;
    config.lags = P + 1;
    okid_square_root_t* longer = make(config);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_square_root_merge(a, longer));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_square_root_merge(a, a));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_merge(a, NULL));
}

/// Doubled until the counts are full: refused then, and what was there stays.
static void merging_counts_to_the_end(void) {
    okid_square_root_t *a = filled(samples, 1000), *b = filled(samples, 1000);
    okid_square_root_gap(b, OKID_MOST_SAMPLES); // as many as are counted at all
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_square_root_merge(a, b));
    TEST_ASSERT_EQUAL_INT64(1000 - P, okid_square_root_rows(a));
    b = filled(samples, 1000);
    okid_square_root_t *pair[2] = {a, b}, *grown = NULL;
    okid_status_t status = OKID_OK;
    int64_t rows = 0;
    for (int n = 0; status == OKID_OK; ++n) { // as Fibonacci's numbers
        TEST_ASSERT_TRUE(n < 100);
        grown = pair[n % 2];
        rows = okid_square_root_rows(grown);
        status = okid_square_root_merge(grown, pair[1 - n % 2]);
    }
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, status);
    TEST_ASSERT_EQUAL_INT64(rows, okid_square_root_rows(grown));
    TEST_ASSERT_TRUE(rows > INT64_C(1) << 60);
}

/// Window with gaps, and forgetting: the numbers of the other kernel after every block.
static void both_kernels_agree(void) {
    for (int n = 0; n < N; n += 331) samples[n * RIG_M + n % RIG_M] = NAN;
    for (int kind = 0; kind < 3; ++kind) {
        okid_square_root_config_t config = plain;
        if (kind > 0) config.block = 100;
        if (kind == 1) config.slots = 4, config.spare_slots = 2;
        if (kind == 2) config.forgetting = 0.998;
        const okid_accumulator_config_t like = {.n_u = RIG_NU,
                                                .n_y = RIG_NY,
                                                .lags = P,
                                                .sample = OKID_SAMPLE_DOUBLE,
                                                .block = config.block,
                                                .slots = config.slots,
                                                .forgetting = config.forgetting,
                                                .edges = 1,
                                                .spare_slots = config.spare_slots};
        okid_square_root_t* r = make(config);
        const size_t bytes = okid_accumulator_memsize(&like);
        void* block = malloc(bytes);
        okid_accumulator_t* a = NULL;
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &like, block, bytes));
        for (int n = 0; n < N; n += 150) {
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_square_root_add(r, samples + n * RIG_M, 150));
            TEST_ASSERT_GREATER_OR_EQUAL(0, okid_accumulator_add(a, samples + n * RIG_M, 150));
            okid_accumulator_stats_t left, right;
            okid_square_root_stats(r, &left);
            okid_accumulator_stats(a, &right);
            TEST_ASSERT_EQUAL_MEMORY(&left, &right, sizeof left);
            TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, OKID_DETREND_NONE, gram, mean));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_NONE, other, other_mean));
            same(other, gram, W * W, 200 * eps);
            same(other_mean, mean, RIG_M, 500 * eps);
        }
        free(block);
        free(blocks[--used]);
    }
}

static void units_and_offsets(void) {
    const double scale[RIG_M] = {2, -0.5, 1e-3, 4}, offset[RIG_M] = {1, 0, -3, 10};
    okid_square_root_t* r = filled(samples, N);
    okid_square_root_set_units(r, scale, offset);
    for (int i = 0; i < N * RIG_M; ++i) samples[i] = scale[i % RIG_M] * samples[i] + offset[i % RIG_M];
    for (int centre = 0; centre < 2; ++centre) {
        const okid_detrend_t detrend = centre ? OKID_DETREND_MEAN : OKID_DETREND_NONE;
        explicit_gram(samples, N, centre, expected);
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, detrend, gram, NULL));
        same(expected, gram, W * W, 200 * eps);
    }
    okid_square_root_set_units(r, scale, NULL);
    okid_square_root_reset(r);
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_square_root_gram(r, OKID_DETREND_NONE, gram, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r, samples, N)); // the units stay
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, OKID_DETREND_MEAN, gram, NULL));
    for (int j = 0; j < W; ++j)
        for (int i = 0; i < W; ++i) expected[j * W + i] *= scale[i % RIG_M] * scale[j % RIG_M];
    same(expected, gram, W * W, 200 * eps);
}

static void a_copy_of_the_block_goes_on_alike(void) {
    okid_square_root_config_t config = plain;
    config.block = 90;
    config.slots = 3;
    const size_t bytes = okid_square_root_memsize(&config);
    okid_square_root_t *a = NULL, *b = NULL;
    void *first = aligned_alloc(64, (bytes + 63) / 64 * 64), *second = aligned_alloc(64, (bytes + 63) / 64 * 64);
    blocks[used++] = first;
    blocks[used++] = second;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&a, &config, first, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&b, &config, second, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(a, samples, 777));
    memcpy(second, first, bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(a, samples + 777 * RIG_M, 500));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(b, samples + 777 * RIG_M, 500));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(a, OKID_DETREND_MEAN, factor, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(b, OKID_DETREND_MEAN, again, NULL));
    TEST_ASSERT_EQUAL_MEMORY(factor, again, sizeof factor);
    okid_square_root_config_t told;
    okid_square_root_config(b, &told);
    TEST_ASSERT_EQUAL(90, told.block);
    TEST_ASSERT_EQUAL(32, told.batch); // what the default stands for
}

// ---- the solver ----------------------------------------------------------------------------------------------------

static const okid_observer_config_t observer = {RIG_NU, RIG_NY, P, 0, 0};

static okid_status_t solve(const okid_observer_config_t* config, const double* v, int count, okid_detrend_t detrend) {
    okid_square_root_t* r = filled(v, count);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(r, detrend, factor, NULL));
    const size_t bytes = okid_observer_factor_memsize(config);
    void* work = malloc(bytes);
    const okid_status_t status =
        okid_observer_solve_factor(config, factor, okid_square_root_rows(r), theta, innovation, &info, work, bytes);
    free(work);
    free(blocks[--used]);
    return status;
}

static double markov_error(void) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(RIG_NU, RIG_NY, P, theta, LAST, markov, gain));
    double worst = 0, size = 0;
    for (int k = 0; k <= LAST; ++k) {
        double truth[RIG_NY];
        rig_markov(&rig, k, truth);
        for (int o = 0; o < RIG_NY; ++o) {
            worst = fmax(worst, fabs(truth[o] - (double)markov[k * RIG_NY + o]));
            size = fmax(size, fabs(truth[o]));
        }
    }
    return worst / size;
}

// Trap 5: without noise the rows have rank n_u + p n_u + n_z = 17 of 41. The Gram matrix leaves 1e-7 of it, the factor
// rounding; trap 4: a structure that already moves changes nothing.
static void trap_05_noise_free_rank_deficiency(void) {
    double x0[RIG_NZ];
    for (int i = 0; i < RIG_NZ; ++i) x0[i] = 30;
    for (int moving = 0; moving < 2; ++moving) {
        double* v = rig_record(&rig, N, 0, moving ? x0 : NULL, 3);
        TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, v, N, OKID_DETREND_NONE));
        TEST_ASSERT_TRUE(markov_error() < 1000 * eps);
        TEST_ASSERT_TRUE(info.radius < 1 && info.radius == info.radius_plain);
        TEST_ASSERT_TRUE(info.condition > 0.1 / (eps * sqrt(eps)));
        TEST_ASSERT_EQUAL_DOUBLE(pow(eps, 1.5), info.ridge);
        TEST_ASSERT_TRUE(largest(&info.input_excitation, 1) > 0.5);
        for (int i = 0; i < RIG_M * N; ++i) v[i] += 20 + i % RIG_M; // sensors with a bias
        TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, v, N, OKID_DETREND_MEAN));
        TEST_ASSERT_TRUE(markov_error() < 1e4 * eps);
        free(v);
    }
}

static void innovation_is_the_noise(void) {
    double* v = rig_record(&rig, 20000, 0.05, NULL, 8);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, v, 20000, OKID_DETREND_NONE));
    for (int o = 0; o < RIG_NY; ++o) { // never below the measurement noise, not far above it
        TEST_ASSERT_TRUE(innovation[o * RIG_NY + o] > 0.95 * 0.15 * 0.15);
        TEST_ASSERT_TRUE(innovation[o * RIG_NY + o] < 2.5 * 0.15 * 0.15);
    }
    free(v);
}

// Trap 22: outputs behind a steep anti-alias filter that the force does not see. The smallest ridge that makes the model
// stable is the one okid_observer_solve() finds.
static void trap_22_unstable_arx_is_stabilised(void) {
    double *v = rig_record(&rig, N, 0, NULL, 9), *filtered = rig_filtered(v, N);
    okid_observer_config_t leave = observer;
    leave.unstable = 1;
    TEST_ASSERT_EQUAL(OKID_OK, solve(&leave, filtered, N, OKID_DETREND_MEAN));
    const double before = info.radius;
    TEST_ASSERT_TRUE(before > 1.1);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, filtered, N, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL_DOUBLE(before, info.radius_plain);
    TEST_ASSERT_TRUE(info.radius < 1);
    const okid_observer_info_t found = info;
    okid_square_root_t* r = filled(filtered, N);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(r, OKID_DETREND_MEAN, gram, NULL));
    const size_t bytes = okid_observer_memsize(&observer);
    void* work = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_observer_solve(&observer, gram, N - P, theta, innovation, &info, work, bytes));
    TEST_ASSERT_EQUAL_DOUBLE(info.ridge, found.ridge);
    TEST_ASSERT_DOUBLE_WITHIN(100 * sqrt(eps), info.radius, found.radius);
    free(work);
    free(v);
    free(filtered);
}

static void what_the_data_do_not_determine_is_refused(void) {
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, solve(&observer, samples, P + Q - 1, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, samples, N, OKID_DETREND_MEAN));
    for (int n = 0; n < N; ++n) samples[n * RIG_M + 2] = 0.1;
    TEST_ASSERT_EQUAL(OKID_ERR_OUTPUT, solve(&observer, samples, N, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL(2, info.channel);
    for (int n = 0; n < N; ++n) samples[n * RIG_M] = 7.7;
    TEST_ASSERT_EQUAL(OKID_ERR_INPUT, solve(&observer, samples, N, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL(0, info.channel);
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    for (int n = 0; n < N; ++n) v[n * RIG_M] = sin(0.3 * n);
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, solve(&observer, v, N, OKID_DETREND_NONE));
    TEST_ASSERT_EQUAL(-1, info.channel);
    TEST_ASSERT_TRUE(info.input_excitation < 1e-10);
    // Two inputs, the second a copy of the first: three outputs become two.
    uint64_t state = 4;
    for (int n = 0; n < N; ++n) {
        v[n * RIG_M] = rig_normal(&state);
        v[n * RIG_M + 1] = -2 * v[n * RIG_M];
    }
    okid_square_root_config_t config = plain;
    config.n_u = 2;
    config.n_y = 2;
    okid_square_root_t* r = make(config);
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r, v, N));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(r, OKID_DETREND_MEAN, factor, NULL));
    const okid_observer_config_t two = {2, 2, P, 0, 0};
    const size_t bytes = okid_observer_factor_memsize(&two);
    void* work = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION,
                      okid_observer_solve_factor(&two, factor, N - P, theta, NULL, &info, work, bytes));
    TEST_ASSERT_EQUAL(1, info.channel);
    free(work);
    free(v);
}

static void wrong_use_is_refused(void) {
    okid_square_root_config_t config = plain;
    const size_t bytes = okid_square_root_memsize(&config);
    char* block = blocks[used++] = malloc(bytes + 1);
    okid_square_root_t* r = NULL;
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_square_root_create(&r, &config, block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_create(&r, &config, NULL, bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_create(NULL, &config, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&r, &config, block + 1, bytes)); // any alignment
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_add(r, NULL, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_add_i16(NULL, NULL, 0));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(r, NULL, 0));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_gram(r, OKID_DETREND_NONE, NULL, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_square_root_factor(r, OKID_DETREND_NONE, factor, NULL));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_square_root_factor(r, OKID_DETREND_NONE, NULL, NULL));
    config.n_y = 0;
    TEST_ASSERT_EQUAL(0, okid_square_root_memsize(&config));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_square_root_create(&r, &config, block, bytes));
    const okid_observer_config_t bad = {0, 3, P, 0, 0};
    char work[16];
    TEST_ASSERT_EQUAL(0, okid_observer_factor_memsize(&bad));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_observer_solve_factor(&bad, factor, N, theta, NULL, &info, work, 16));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_observer_solve_factor(&observer, factor, N, theta, NULL, &info, work, 16));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_observer_solve_factor(&observer, NULL, N, theta, NULL, &info, work, 16));
    TEST_ASSERT_EQUAL(OKID_OK, solve(&observer, samples, N, OKID_DETREND_MEAN));
    factor[3 * W + 1] = (okid_real_t)NAN;
    const size_t room = okid_observer_factor_memsize(&observer);
    void* enough = blocks[used++] = malloc(room);
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC,
                      okid_observer_solve_factor(&observer, factor, N, theta, NULL, &info, enough, room));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(gram_equals_explicit_rows);
    RUN_TEST(factor_is_a_root_of_the_gram_matrix);
    RUN_TEST(any_split_gives_the_same_bits);
    RUN_TEST(all_kinds_of_numbers_give_the_same_bits);
    RUN_TEST(bad_samples_never_poison);
    RUN_TEST(merging_stacks_records);
    RUN_TEST(merging_counts_to_the_end);
    RUN_TEST(both_kernels_agree);
    RUN_TEST(units_and_offsets);
    RUN_TEST(a_copy_of_the_block_goes_on_alike);
    RUN_TEST(trap_05_noise_free_rank_deficiency);
    RUN_TEST(innovation_is_the_noise);
    RUN_TEST(trap_22_unstable_arx_is_stabilised);
    RUN_TEST(what_the_data_do_not_determine_is_refused);
    RUN_TEST(wrong_use_is_refused);
    return UNITY_END();
}
