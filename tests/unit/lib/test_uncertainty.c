// SPDX-License-Identifier: MIT
// Parts of a record taken away again, replicate models without one part each, and the standard deviations they give.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 12, N = 4000, W = RIG_M * (P + 1), PARTS = 10 };

static rig_t rig;
static double *record, gram[W * W], other[W * W];
static int16_t codes[N * RIG_M];

void setUp(void) {
    rig_make(&rig);
    record = rig_record(&rig, N, 0.02, NULL, 7);
    for (int i = 0; i < N * RIG_M; ++i) codes[i] = (int16_t)lrint(record[i] * 800);
}
void tearDown(void) { free(record); }

static okid_accumulator_config_t shape_of(okid_sample_t sample) {
    return (okid_accumulator_config_t){
        .n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .sample = sample, .forgetting = 1, .edges = 1};
}

static okid_accumulator_t* make(const okid_accumulator_config_t* config) { // the block begins where the object does
    const size_t bytes = okid_accumulator_memsize(config);
    TEST_ASSERT_TRUE(bytes > 0);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, config, aligned_alloc(16, (bytes + 15) / 16 * 16), bytes));
    return a;
}

/// Samples first .. last-1 behind the P samples before them.
static void feed(okid_accumulator_t* a, int first, int last) {
    const int from = first < P ? 0 : first - P;
    const size_t count = (size_t)(last - from);
    okid_accumulator_config_t config;
    okid_accumulator_config(a, &config);
    TEST_ASSERT_EQUAL(OKID_OK, config.sample == OKID_SAMPLE_INT16
                                   ? okid_accumulator_add_i16(a, codes + from * RIG_M, count)
                                   : okid_accumulator_add(a, record + (size_t)from * RIG_M, count));
}

static void gram_of(okid_accumulator_t* a, double* out) {
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, OKID_DETREND_MEAN, out, NULL));
}

static double worst_difference(double scale) {
    double worst = 0;
    for (int i = 0; i < W * W; ++i) worst = fmax(worst, fabs(gram[i] - other[i]));
    return worst / scale;
}

static void assert_same_stats(const okid_accumulator_t* a, const okid_accumulator_t* b) {
    okid_accumulator_stats_t x, y;
    okid_accumulator_stats(a, &x);
    okid_accumulator_stats(b, &y);
    TEST_ASSERT_EQUAL_MEMORY(&x, &y, sizeof x);
}

static void removal_is_the_inverse_of_merging(void) {
    for (okid_sample_t sample = OKID_SAMPLE_DOUBLE; sample <= OKID_SAMPLE_INT16; ++sample) {
        const okid_accumulator_config_t config = shape_of(sample);
        okid_accumulator_t *a = make(&config), *b = make(&config), *alone = make(&config);
        feed(a, 0, 1500);
        feed(alone, 0, 1500);
        feed(b, 2000, 2600);
        okid_accumulator_gap(b, 5);
        feed(b, 3000, 3700);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(a, b));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(a, b, 1));
        gram_of(a, gram);
        gram_of(alone, other);
        if (sample == OKID_SAMPLE_INT16)
            TEST_ASSERT_EQUAL_MEMORY(other, gram, sizeof gram);
        else
            TEST_ASSERT_TRUE(worst_difference(other[0]) < 1e-13);
        assert_same_stats(a, alone);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(a, alone, 1)); // nothing is left
        TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_accumulator_gram(a, OKID_DETREND_MEAN, gram, NULL));
        free(a), free(b), free(alone);
    }
}

/// Each part is fed with the samples before it; any part can go, the others stay.
static void parts_of_a_record_add_up_to_it(void) {
    const okid_accumulator_config_t config = shape_of(OKID_SAMPLE_INT16);
    okid_accumulator_t *whole = make(&config), *sum = make(&config), *rest = make(&config), *part = make(&config);
    feed(whole, 0, N);
    for (int k = 0; k < PARTS; ++k) {
        okid_accumulator_reset(part);
        feed(part, k * N / PARTS, (k + 1) * N / PARTS);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(sum, part));
    }
    gram_of(whole, gram);
    gram_of(sum, other);
    TEST_ASSERT_EQUAL_MEMORY(other, gram, sizeof gram);
    okid_accumulator_reset(sum);
    for (int k = 0; k < PARTS; ++k) {
        okid_accumulator_reset(part);
        feed(part, k * N / PARTS, (k + 1) * N / PARTS);
        if (k != 4)
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(sum, part));
        else {
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(rest, whole));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(rest, part, 1));
        }
    }
    gram_of(rest, gram);
    gram_of(sum, other);
    TEST_ASSERT_EQUAL_MEMORY(other, gram, sizeof gram);
    gram_of(whole, other); // untouched
    TEST_ASSERT_EQUAL(okid_accumulator_rows(whole), okid_accumulator_rows(rest) + N / PARTS);
    free(whole), free(sum), free(rest), free(part);
}

static void removal_refuses_what_does_not_fit(void) {
    okid_accumulator_config_t config = shape_of(OKID_SAMPLE_DOUBLE);
    okid_accumulator_t *a = make(&config), *b = make(&config);
    config.lags = P + 1;
    okid_accumulator_t* longer = make(&config);
    config.lags = P;
    config.block = 100;
    config.slots = 4;
    okid_accumulator_t* window = make(&config);
    feed(a, 0, 500);
    feed(b, 0, 600);
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_remove(a, NULL, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(a, a, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(a, longer, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(a, window, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(a, b, 1)); // it holds more
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_remove(b, a, 0.5));  // nothing fades here
    TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_remove(b, a, 0));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_copy(a, longer));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_take_slots(window, a, 0, 1));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_slots(a, window, 0, 2));
    gram_of(a, gram);
    okid_accumulator_reset(b);
    feed(b, 0, 500);
    gram_of(b, other);
    TEST_ASSERT_TRUE(worst_difference(other[0]) < 1e-15); // unchanged by all of this
    free(a), free(b), free(longer), free(window);
}

/// With forgetting a part fades with its age: what is left is what the newer part holds alone.
static void faded_parts_are_removed_with_their_weight(void) {
    enum { BLOCK = 50 };
    const double lambda = 0.999;
    okid_accumulator_config_t config = shape_of(OKID_SAMPLE_DOUBLE);
    config.forgetting = lambda;
    config.block = BLOCK;
    okid_accumulator_t *whole = make(&config), *old = make(&config), *young = make(&config);
    const int cut = P + 40 * BLOCK;
    feed(whole, 0, N);
    feed(old, 0, cut);
    feed(young, cut, N);
    const int64_t open = okid_accumulator_slot_rows(whole, okid_accumulator_slots(whole) - 1);
    TEST_ASSERT_EQUAL(1, okid_accumulator_slots(whole));
    TEST_ASSERT_EQUAL((N - P) % BLOCK, open);
    TEST_ASSERT_EQUAL(0, okid_accumulator_slot_rows(old, 0));
    const double weight = pow(lambda, (double)(okid_accumulator_rows(young) - open));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(whole, old, weight));
    gram_of(whole, gram);
    gram_of(young, other);
    TEST_ASSERT_TRUE(worst_difference(other[0]) < 1e-12);
    free(whole), free(old), free(young);
}

static void slots_of_a_window_are_its_parts(void) {
    okid_accumulator_config_t config = shape_of(OKID_SAMPLE_INT16);
    okid_accumulator_t *whole = make(&config), *part = make(&config), *rest = make(&config);
    config.block = 200;
    config.slots = 8;
    config.spare_slots = 4;
    okid_accumulator_t* window = make(&config);
    feed(window, 0, 3000);
    okid_accumulator_gap(window, 3);
    feed(window, 3100, 3750);
    const int32_t slots = okid_accumulator_slots(window);
    int64_t rows = 0;
    for (int32_t k = 0; k < slots; ++k) rows += okid_accumulator_slot_rows(window, k);
    TEST_ASSERT_EQUAL(okid_accumulator_rows(window), rows);
    TEST_ASSERT_EQUAL(0, okid_accumulator_slot_rows(window, slots));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(whole, window, 0, slots));
    gram_of(window, gram);
    gram_of(whole, other);
    TEST_ASSERT_EQUAL_MEMORY(other, gram, sizeof gram);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(part, window, 2, 3));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(rest, window, 0, 2));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(rest, window, 5, slots - 5));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(whole, part, 1));
    gram_of(whole, gram);
    gram_of(rest, other);
    TEST_ASSERT_EQUAL_MEMORY(other, gram, sizeof gram);
    TEST_ASSERT_EQUAL(okid_accumulator_rows(window), okid_accumulator_rows(part) + okid_accumulator_rows(rest));
    free(whole), free(part), free(rest), free(window);
}

/// A window whose slots are paired up when they are all full holds the whole record, gaps or not, in slots of any length.
static void paired_slots_hold_what_they_were(void) {
    for (okid_sample_t sample = OKID_SAMPLE_DOUBLE; sample <= OKID_SAMPLE_INT16; ++sample) {
        okid_accumulator_config_t config = shape_of(sample);
        okid_accumulator_t *whole = make(&config), *taken = make(&config), *part = make(&config);
        feed(whole, 0, 1500);
        okid_accumulator_gap(whole, 0);
        feed(whole, 1600, N);
        config.block = 50;
        config.slots = 24;
        okid_accumulator_t* window = make(&config);
        int paired = 0;
        const int cuts[][2] = {{0, 700}, {700, 1500}, {1600, 2600}, {2600, 3500}, {3500, N}};
        for (int k = 0; k < 5; ++k) {
            if (k == 2) okid_accumulator_gap(window, 0);
            for (int n = cuts[k][0]; n < cuts[k][1]; ++n) {
                const int from =
                    k == 2 && n == cuts[k][0] ? n - P : n; // feed() begins a run behind the samples before it
                TEST_ASSERT_EQUAL(
                    OKID_OK, sample == OKID_SAMPLE_INT16
                                 ? okid_accumulator_add_i16(window, codes + from * RIG_M, (size_t)(n + 1 - from))
                                 : okid_accumulator_add(window, record + (size_t)from * RIG_M, (size_t)(n + 1 - from)));
                if (okid_accumulator_slots(window) <= 16) continue;
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_pair_slots(window));
                TEST_ASSERT_TRUE(okid_accumulator_slots(window) <= 10);
                ++paired;
            }
        }
        TEST_ASSERT_TRUE(paired >= 2);
        TEST_ASSERT_EQUAL(okid_accumulator_rows(whole), okid_accumulator_rows(window));
        gram_of(whole, gram);
        gram_of(window, other);
        TEST_ASSERT_TRUE(sample == OKID_SAMPLE_INT16 ? memcmp(gram, other, sizeof gram) == 0
                                                     : worst_difference(other[0]) < 1e-12);
        const int32_t slots = okid_accumulator_slots(window);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(taken, window, 0, slots));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(part, window, 0, 3));
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_drop_slots(window, slots));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_drop_slots(window, 3));
        TEST_ASSERT_EQUAL(slots - 3, okid_accumulator_slots(window));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(taken, part, 1));
        gram_of(taken, gram);
        gram_of(window, other);
        TEST_ASSERT_TRUE(sample == OKID_SAMPLE_INT16 ? memcmp(gram, other, sizeof gram) == 0
                                                     : worst_difference(other[0]) < 1e-12);
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_pair_slots(whole));
        free(whole), free(taken), free(part), free(window);
    }
}

/// Sums to more lags give those to fewer: the same rows, their first lags.
static void longer_sums_hold_shorter_ones(void) {
    for (okid_sample_t sample = OKID_SAMPLE_DOUBLE; sample <= OKID_SAMPLE_INT16; ++sample) {
        okid_accumulator_config_t config = shape_of(sample);
        okid_accumulator_t *merged = make(&config), *taken = make(&config), *direct = make(&config);
        config.lags = P + 5;
        okid_accumulator_t* longer = make(&config);
        feed(longer, P, 900);
        okid_accumulator_gap(longer, 2);
        feed(longer, 1200 + P, 2000);
        config.edges = 0;
        config.block = 100;
        config.slots = 20;
        okid_accumulator_t* window = make(&config);
        feed(window, P, 900);
        okid_accumulator_gap(window, 2);
        feed(window, 1200 + P, 2000);
        feed(direct, P + 5, 900); // its first row stands behind as many samples
        okid_accumulator_gap(direct, 0);
        feed(direct, 1200 + P + 5, 2000);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(merged, longer));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_slots(taken, window, 0, okid_accumulator_slots(window)));
        TEST_ASSERT_EQUAL(okid_accumulator_rows(direct), okid_accumulator_rows(merged));
        gram_of(direct, gram);
        for (int k = 0; k < 2; ++k) {
            gram_of(k == 0 ? merged : taken, other);
            TEST_ASSERT_TRUE(sample == OKID_SAMPLE_INT16 ? memcmp(gram, other, sizeof gram) == 0
                                                         : worst_difference(other[0]) < 1e-13);
        }
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_merge(longer, merged));
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_remove(merged, longer, 1));
        free(merged), free(taken), free(direct), free(longer), free(window);
    }
}

static void energy_is_the_diagonal(void) {
    for (okid_sample_t sample = OKID_SAMPLE_DOUBLE; sample <= OKID_SAMPLE_INT16; ++sample) {
        const okid_accumulator_config_t config = shape_of(sample);
        okid_accumulator_t* a = make(&config);
        double energy[RIG_M], scale[RIG_M] = {0.5, 2, 3, 4}, offset[RIG_M] = {1, -2, 0, 5};
        TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, okid_accumulator_energy(a, OKID_DETREND_MEAN, energy));
        okid_accumulator_set_units(a, scale, offset);
        feed(a, 0, 900);
        okid_accumulator_gap(a, 1);
        feed(a, 1500, 2300);
        for (okid_detrend_t detrend = OKID_DETREND_NONE; detrend <= OKID_DETREND_MEAN; ++detrend) {
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, detrend, gram, NULL));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(a, detrend, energy));
            for (int c = 0; c < RIG_M; ++c)
                TEST_ASSERT_TRUE(fabs(energy[c] - gram[c * (W + 1)]) <= 1e-14 * gram[c * (W + 1)]);
        }
        free(a);
    }
}

/// The rig with its frequencies and damping ratios changed, in other states and another scale of the shapes.
typedef struct variant_t {
    okid_real_t A[RIG_NZ * RIG_NZ], C[RIG_NY * RIG_NZ];
} variant_t;

static okid_model_t vary(variant_t* v, const double* df, const double* dzeta, const double* dshape, int modes) {
    memset(v, 0, sizeof *v);
    const int n = 2 * modes;
    for (int k = 0; k < modes; ++k) {
        const double omega = 6.283185307179586 * (rig_frequency[k] + df[k]), zeta = rig_damping[k] + dzeta[k];
        const double radius = exp(-zeta * omega / RIG_FS), angle = omega * sqrt(1 - zeta * zeta) / RIG_FS;
        const int i = 2 * (modes - 1 - k); // in another order
        v->A[i * n + i] = v->A[(i + 1) * n + i + 1] = (okid_real_t)(radius * cos(angle));
        v->A[i * n + i + 1] = (okid_real_t)(radius * sin(angle));
        v->A[(i + 1) * n + i] = (okid_real_t)(-radius * sin(angle));
        for (int o = 0; o < RIG_NY; ++o) {
            const double re = 1 + (o == 0 ? 0.5 : 0.1 * o + dshape[k]), im = 0;
            const double turn = 0.7 * k, size = 2 + k; // what the shape must not depend on
            v->C[i * RIG_NY + o] = (okid_real_t)(size * (re * cos(turn) - im * sin(turn)));
            v->C[(i + 1) * RIG_NY + o] = (okid_real_t)(size * (re * sin(turn) + im * cos(turn)));
        }
    }
    return (okid_model_t){.n_u = RIG_NU, .n_y = RIG_NY, .n_z = n, .A = v->A, .C = v->C};
}

static okid_replicates_t* replicates_for(const okid_replicates_config_t* config, void** block) {
    const size_t bytes = okid_replicates_memsize(config);
    *block = malloc(bytes);
    okid_replicates_t* r = NULL;
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_replicates_create(&r, config, *block, bytes - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&r, config, *block, bytes));
    return r;
}

/// Against the formula of the header, computed here from the numbers that went in.
static double expected(const double* value, const double* share, int count) {
    double left = 0, centre = 0, sum = 0, weight = 0;
    for (int j = 0; j < count; ++j) {
        left += 1 - share[j];
        centre += (1 - share[j]) * value[j];
    }
    for (int j = 0; j < count; ++j) {
        sum += pow((1 - share[j]) * (value[j] - centre / left), 2);
        weight += share[j] * (1 - share[j]);
    }
    return sqrt(sum / weight);
}

static void deviations_are_those_of_the_formula(void) {
    enum { G = 12 };
    const okid_replicates_config_t config = {RIG_NU, RIG_NY, RIG_NZ, NULL};
    void* block;
    okid_replicates_t* r = replicates_for(&config, &block);
    variant_t v;
    const double zero[RIG_MODES] = {0};
    okid_model_t model = vary(&v, zero, zero, zero, RIG_MODES);
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(r, &model, 1 / RIG_FS));
    double f[RIG_MODES][G], zeta[RIG_MODES][G], shape[RIG_MODES][G], share[G], total = 0;
    uint64_t state = 3;
    for (int j = 0; j < G; ++j) total += share[j] = 0.5 + rig_uniform(&state); // unequal blocks
    for (int j = 0; j < G; ++j) {
        double df[RIG_MODES], dz[RIG_MODES], ds[RIG_MODES];
        share[j] /= total;
        for (int k = 0; k < RIG_MODES; ++k) {
            f[k][j] = df[k] = 0.02 * rig_normal(&state);
            zeta[k][j] = dz[k] = 5e-4 * rig_normal(&state);
            ds[k] = 0.01 * rig_normal(&state);
            shape[k][j] = (1.1 + ds[k]) / 1.5;
        }
        model = vary(&v, df, dz, ds, RIG_MODES);
        TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_add(r, &model, share[j]));
    }
    okid_uncertainty_t out;
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_finish(r, &out));
    TEST_ASSERT_EQUAL(RIG_MODES, out.mode_count);
    TEST_ASSERT_EQUAL(G, out.models);
    const double limit = TOLERANCE(1e-9, 5e-3);
    okid_modes_t last;
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_last(r, &last));
    TEST_ASSERT_EQUAL(RIG_MODES, last.count);
    for (int k = 0; k < RIG_MODES; ++k) {
        const double moved = last.frequency_hz[k] - rig_frequency[k];
        TEST_ASSERT_TRUE(fabs(moved - f[k][G - 1]) < TOLERANCE(1e-9, 1e-3));
        TEST_ASSERT_EQUAL(G, out.used[k]);
        TEST_ASSERT_TRUE(fabs(out.frequency_std_hz[k] / expected(f[k], share, G) - 1) < limit);
        TEST_ASSERT_TRUE(fabs(out.damping_ratio_std[k] / expected(zeta[k], share, G) - 1) < limit);
        TEST_ASSERT_TRUE(fabs(out.shape_re_std[k * RIG_NY + 1] / expected(shape[k], share, G) - 1) < limit);
        TEST_ASSERT_TRUE(out.shape_re_std[k * RIG_NY] == 0 && out.shape_im_std[k * RIG_NY] == 0);
        TEST_ASSERT_TRUE(out.shape_im_std[k * RIG_NY + 1] < TOLERANCE(1e-12, 1e-5));
    }
    TEST_ASSERT_EQUAL(0, out.n_x);
    TEST_ASSERT_NULL(out.M_std);
    TEST_ASSERT_TRUE(isnan(out.alpha_std));
    free(block);
}

/// A mode that most replicates lack, or that has moved too far, has no deviation; the others keep theirs.
static void missing_modes_are_counted(void) {
    enum { G = 10 };
    const okid_replicates_config_t config = {RIG_NU, RIG_NY, RIG_NZ, NULL};
    void* block;
    okid_replicates_t* r = replicates_for(&config, &block);
    variant_t v;
    const double zero[RIG_MODES] = {0};
    okid_model_t model = vary(&v, zero, zero, zero, RIG_MODES);
    okid_uncertainty_t out;
    TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(r, &model, 1 / RIG_FS));
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_replicates_finish(r, &out)); // nothing came yet
    TEST_ASSERT_TRUE(isnan(out.frequency_std_hz[0]));
    for (int j = 0; j < G; ++j) {
        const double df[RIG_MODES] = {0.01 * (j % 3), j == 5 ? 8.0 : 0.02 * (j % 2), 0.01 * j};
        model = vary(&v, df, zero, zero, j < 4 ? 2 : RIG_MODES);
        const int whole = j >= 4 && j != 5;
        if (j == 7)
            TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_replicates_add(r, NULL, 1.0 / G));
        else
            TEST_ASSERT_EQUAL(whole ? OKID_OK : OKID_WARN_MODEL, okid_replicates_add(r, &model, 1.0 / G));
    }
    TEST_ASSERT_EQUAL(OKID_WARN_MODEL, okid_replicates_finish(r, &out));
    TEST_ASSERT_EQUAL(G, out.replicates);
    TEST_ASSERT_EQUAL(G - 1, out.models);
    TEST_ASSERT_EQUAL(G - 1, out.used[0]);
    TEST_ASSERT_EQUAL(G - 2, out.used[1]);
    TEST_ASSERT_EQUAL(G - 5, out.used[2]);
    TEST_ASSERT_TRUE(out.frequency_std_hz[0] > 0 && out.frequency_std_hz[1] > 0);
    TEST_ASSERT_TRUE(isnan(out.frequency_std_hz[2]) && isnan(out.shape_re_std[2 * RIG_NY + 1]));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_replicates_add(r, &model, 0));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_replicates_add(r, &model, 1));
    model.n_y = RIG_NY - 1;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_replicates_add(r, &model, 0.1));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_replicates_add(NULL, &model, 0.1));
    free(block);
}

typedef struct deletion_t {
    void* blocks[4];
    okid_identify_t* identify;
    okid_jackknife_t* jackknife;
    okid_identified_t full;
} deletion_t;

static void prepare(deletion_t* d, okid_method_t method, okid_accumulator_t* whole) {
    okid_jackknife_config_t config = {.identify = {.n_u = RIG_NU,
                                                   .n_y = RIG_NY,
                                                   .p = P,
                                                   .max_order = 20,
                                                   .fs_hz = RIG_FS,
                                                   .method = method,
                                                   .detrend = OKID_DETREND_MEAN}};
    if (method >= OKID_METHOD_N4SID_MOESP) config.identify.rows = (P + 1) / 2, config.identify.p = 0;
    okid_accumulator_config(whole, &config.sums);
    const size_t bytes = okid_identify_memsize(&config.identify), more = okid_jackknife_memsize(&config);
    TEST_ASSERT_TRUE(more > bytes);
    d->blocks[0] = malloc(bytes);
    d->blocks[1] = malloc(more);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&d->identify, &config.identify, d->blocks[0], bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_jackknife_create(&d->jackknife, &config, d->blocks[1], more - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&d->jackknife, &config, d->blocks[1], more));
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run(d->identify, whole, &d->full));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin(d->jackknife, whole, &d->full));
    config.sums.slots = 3;
    TEST_ASSERT_EQUAL(0, okid_jackknife_memsize(&config));
}

/// Mean over the channels of what the part has of their energy.
static double energy_share(okid_accumulator_t* whole, okid_accumulator_t* part) {
    double all[RIG_M], own[RIG_M], sum = 0;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(whole, OKID_DETREND_MEAN, all));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(part, OKID_DETREND_MEAN, own));
    for (int c = 0; c < RIG_M; ++c) sum += own[c] / all[c];
    return sum / RIG_M;
}

/// What is deleted is what the accumulator of everything else would give, at the order of the full model: within 1e-4 of
/// the change where ERA starts from the full model, else to rounding.
static void a_replicate_is_the_model_of_the_rest(void) {
    static const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_OKID_ERA_DC, OKID_METHOD_N4SID_MOESP,
                                            OKID_METHOD_N4SID_CVA, OKID_METHOD_N4SID_SSARX};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; ++i) {
        okid_accumulator_config_t config = shape_of(OKID_SAMPLE_DOUBLE);
        if (methods[i] >= OKID_METHOD_N4SID_MOESP) config.lags = (P + 1) / 2 * 2 - 1;
        okid_accumulator_t *whole = make(&config), *part = make(&config), *rest = make(&config);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(whole, record, N));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(part, record + (size_t)(1000 - config.lags) * RIG_M,
                                                        (size_t)(400 + config.lags)));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(rest, record, 1000));
        okid_accumulator_gap(rest, 0);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(rest, record + (size_t)(1400 - config.lags) * RIG_M,
                                                        (size_t)(N - 1400 + config.lags)));
        deletion_t d;
        prepare(&d, methods[i], whole);
        const int order = d.full.n_z;
        TEST_ASSERT_EQUAL(RIG_NZ, order);
        double before[RIG_MODES], zeta_before[RIG_MODES];
        for (int k = 0; k < RIG_MODES; ++k)
            before[k] = d.full.frequency_hz[k], zeta_before[k] = d.full.damping_ratio[k];
        okid_model_t model;
        double share = 0;
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(d.jackknife, part, 1, &model, &share));
        TEST_ASSERT_TRUE(fabs(share - energy_share(whole, part)) < 1e-12);
        okid_identified_t exact;
        TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run(d.identify, rest, &exact));
        TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_order(d.identify, order, &exact));
        okid_real_t f[RIG_NZ / 2], z[RIG_NZ / 2];
        const size_t bytes = okid_modal_memsize(RIG_NY, RIG_NZ);
        void* work = malloc(bytes);
        okid_modes_t modes = {.frequency_hz = f, .damping_ratio = z};
        TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(&model, 1 / RIG_FS, &modes, work, bytes));
        TEST_ASSERT_EQUAL(RIG_MODES, modes.count);
        const double part_of_change = methods[i] == OKID_METHOD_OKID_ERA ? 1e-4 : 1e-6;
        for (int k = 0; k < RIG_MODES; ++k) {
            const double floor = TOLERANCE(1e-12, 1e-5);
            const double df = fabs(exact.frequency_hz[k] - before[k]),
                         dz = fabs(exact.damping_ratio[k] - zeta_before[k]);
            TEST_ASSERT_TRUE(df > 0 && dz > 0);
            TEST_ASSERT_TRUE(fabs(f[k] - exact.frequency_hz[k]) < part_of_change * df + floor * f[k]);
            TEST_ASSERT_TRUE(fabs(z[k] - exact.damping_ratio[k]) < part_of_change * dz + floor);
        }
        free(work);
        free(d.blocks[0]), free(d.blocks[1]);
        free(whole), free(part), free(rest);
    }
}

/// The block that alone excites cannot be left out: there is no model, and the share says why.
static void an_indispensable_part_has_a_share(void) {
    const okid_accumulator_config_t config = shape_of(OKID_SAMPLE_DOUBLE);
    okid_accumulator_t *whole = make(&config), *part = make(&config);
    for (int n = 0; n < N; ++n)
        if (n < 1000 || n >= 1400) record[(size_t)n * RIG_M] = 0;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(whole, record, N));
    feed(part, 1000, 1400 + P);
    deletion_t d;
    prepare(&d, OKID_METHOD_OKID_ERA, whole);
    okid_model_t model;
    double share = 0;
    TEST_ASSERT_EQUAL(OKID_ERR_INPUT, okid_jackknife_delete(d.jackknife, part, 1, &model, &share));
    TEST_ASSERT_TRUE(share > 0.25 && share < 1); // all of the input
    TEST_ASSERT_TRUE(fabs(share - energy_share(whole, part)) < 1e-12);
    free(d.blocks[0]), free(d.blocks[1]);
    free(whole), free(part);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(removal_is_the_inverse_of_merging);
    RUN_TEST(parts_of_a_record_add_up_to_it);
    RUN_TEST(removal_refuses_what_does_not_fit);
    RUN_TEST(faded_parts_are_removed_with_their_weight);
    RUN_TEST(slots_of_a_window_are_its_parts);
    RUN_TEST(paired_slots_hold_what_they_were);
    RUN_TEST(longer_sums_hold_shorter_ones);
    RUN_TEST(energy_is_the_diagonal);
    RUN_TEST(deviations_are_those_of_the_formula);
    RUN_TEST(missing_modes_are_counted);
    RUN_TEST(a_replicate_is_the_model_of_the_rest);
    RUN_TEST(an_indispensable_part_has_a_share);
    return UNITY_END();
}
