// SPDX-License-Identifier: MIT
// The derivative of an identification along the sums of a part, of several forces and sensors, against central
// differences of the identification itself. The order is all that there is room for.
#include "tolerance.h"
#include "wide_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { P = 12, ROWS = 8, N = 4000, FIRST = 2000, LAST = 2020, BLOCKS = 8, MOST = BLOCKS * WIDE_MOST * WIDE_MOST };

static wide_t rig;
static double *record, *outputs; // the same without the forces

void setUp(void) {}
void tearDown(void) {
    free(record), free(outputs);
    record = outputs = NULL;
}

/// Two forces and three sensors, three forces and two sensors, with noise of this size and offsets.
static void make(int which, double noise) {
    wide_make(&rig, 2 + which, 3 - which);
    const int m = rig.n_u + rig.n_y;
    tearDown();
    record = wide_record(&rig, N, noise, 11 + (uint64_t)which);
    outputs = malloc(sizeof *outputs * (size_t)(N * rig.n_y));
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < m; ++c) {
            record[n * m + c] += 1 + c;
            if (c >= rig.n_u) outputs[n * rig.n_y + c - rig.n_u] = record[n * m + c];
        }
}

/// What does not depend on the states: modes by frequency, shapes with the first output 1, Y_0 ..
typedef struct printed_t {
    double modes[2 * WIDE_MODES], shapes[2 * WIDE_MODES * WIDE_MOST], markov[MOST];
} printed_t;

static printed_t print_model(const okid_model_t* model) {
    printed_t out = {0};
    okid_real_t f[WIDE_MODES], zeta[WIDE_MODES], re[WIDE_MODES * WIDE_MOST], im[WIDE_MODES * WIDE_MOST];
    const int n_y = model->n_y;
    const size_t bytes = okid_modal_memsize(n_y, model->n_z);
    void* work = malloc(bytes);
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta, .shape_re = re, .shape_im = im};
    TEST_ASSERT_EQUAL(WIDE_NZ, model->n_z);
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(model, 1 / WIDE_FS, &modes, work, bytes));
    free(work);
    TEST_ASSERT_EQUAL(WIDE_MODES, modes.count);
    for (int k = 0; k < WIDE_MODES; ++k) {
        out.modes[2 * k] = (double)f[k] / wide_frequency[k];
        out.modes[2 * k + 1] = (double)zeta[k];
        const double a = (double)re[k * n_y], b = (double)im[k * n_y];
        for (int o = 0; o < n_y; ++o) {
            const double x = (double)re[k * n_y + o], y = (double)im[k * n_y + o];
            out.shapes[2 * (k * n_y + o)] = (x * a + y * b) / (a * a + b * b);
            out.shapes[2 * (k * n_y + o) + 1] = (y * a - x * b) / (a * a + b * b);
        }
    }
    if (model->n_u > 0)
        wide_markov(model->n_u, n_y, WIDE_NZ, model->A, model->B, model->C, model->D, BLOCKS - 1, out.markov);
    return out;
}

typedef struct setting_t {
    okid_jackknife_config_t config;
    okid_accumulator_t *whole, *part, *more, *less;
    void* blocks[6];
    okid_identify_t* identify;
    okid_identified_t full;
    okid_jackknife_t* jackknife;
} setting_t;

static okid_accumulator_t* fed(setting_t* s, int place, int first, int last) {
    const int n_u = s->config.identify.n_u;
    const size_t bytes = okid_accumulator_memsize(&s->config.sums);
    okid_accumulator_t* a = NULL;
    s->blocks[place] = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &s->config.sums, s->blocks[place], bytes));
    const double* from = n_u > 0 ? record + first * (n_u + rig.n_y) : outputs + first * rig.n_y;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a, from, (size_t)(last - first)));
    return a;
}

static setting_t prepare(okid_method_t method, int n_u) {
    setting_t s = {.config = {.identify = {.n_u = n_u,
                                           .n_y = rig.n_y,
                                           .p = method < OKID_METHOD_N4SID_MOESP && n_u > 0 ? P : 0,
                                           .rows = ROWS,
                                           .order = WIDE_NZ,
                                           .max_order = WIDE_NZ,
                                           .fs_hz = WIDE_FS,
                                           .method = method,
                                           .detrend = OKID_DETREND_MEAN},
                              .linear = 1}};
    const int lags = okid_identify_lags(&s.config.identify);
    s.config.sums = (okid_accumulator_config_t){
        .n_u = n_u, .n_y = rig.n_y, .lags = lags, .sample = OKID_SAMPLE_DOUBLE, .forgetting = 1, .edges = 1};
    s.whole = fed(&s, 0, 0, N);
    s.part = fed(&s, 1, FIRST - lags, LAST);
    s.more = fed(&s, 2, 0, N);
    s.less = fed(&s, 3, 0, N);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(s.more, s.part));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(s.less, s.part, 1));
    const size_t bytes = okid_identify_memsize(&s.config.identify), more = okid_jackknife_memsize(&s.config);
    TEST_ASSERT_GREATER_THAN(0, more);
    s.blocks[4] = malloc(bytes), s.blocks[5] = malloc(more);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s.identify, &s.config.identify, s.blocks[4], bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&s.jackknife, &s.config, s.blocks[5], more));
    return s;
}

static void release(setting_t* s) {
    for (int k = 0; k < 6; ++k) free(s->blocks[k]);
}

static printed_t identified(setting_t* s, okid_accumulator_t* from) {
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run(s->identify, from, &s->full));
    const okid_identified_t* m = &s->full;
    const okid_model_t model = {m->n_u, m->n_y, m->n_z, m->A, m->B, m->C, m->D, NULL};
    return print_model(&model);
}

/// The model with the part left out, or taken twice.
static printed_t changed(setting_t* s, double weight, double* share) {
    okid_model_t model;
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s->jackknife, s->part, weight, &model, share));
    return print_model(&model);
}

/// Largest difference of the two changes, over the largest change; `scale` of the step down, that up is 1.
static double worst(const double* low, const double* high, const double* down, const double* up, double scale, int n) {
    double difference = 0, largest = 0;
    for (int k = 0; k < n; ++k) {
        const double central = (high[k] - low[k]) / 2, linear = (up[k] - down[k]) / (1 + 1 / scale);
        difference = fmax(difference, fabs(linear - central));
        largest = fmax(largest, fabs(central));
    }
    return difference / largest;
}

static void is_the_derivative(okid_method_t method, int n_u) {
    setting_t s = prepare(method, n_u);
    const printed_t low = identified(&s, s.less), high = identified(&s, s.more);
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    double share = 0;
    const printed_t down = changed(&s, 1, &share), up = changed(&s, -1, &share), again = changed(&s, 1, &share);
    const double scale = 1 - share, most = TOLERANCE(2e-3, 0.5); // the step is one part in 200
    TEST_ASSERT_TRUE(worst(low.modes, high.modes, down.modes, up.modes, scale, 2 * WIDE_MODES) < most);
    TEST_ASSERT_TRUE(worst(low.shapes, high.shapes, down.shapes, up.shapes, scale, 2 * WIDE_MODES * rig.n_y) < most);
    const int inputs_stay = method == OKID_METHOD_N4SID_MOESP || method == OKID_METHOD_N4SID_CVA;
    const double by_markov = worst(low.markov, high.markov, down.markov, up.markov, scale, BLOCKS * n_u * rig.n_y);
    TEST_ASSERT_TRUE(inputs_stay || n_u == 0 || by_markov < most);
    okid_model_t none;
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_jackknife_delete(s.jackknife, NULL, 1, &none, &share)); // no part, no change
    TEST_ASSERT_EQUAL_MEMORY(&down, &again, sizeof down); // what is asked in between leaves nothing behind
    release(&s);
}

static void okid_of_several_channels(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 0.3);
        is_the_derivative(OKID_METHOD_OKID_ERA, rig.n_u);
        make(which, 1.5); // terms of second order in the noise show
        is_the_derivative(OKID_METHOD_OKID_ERA_DC, rig.n_u);
    }
}

static void subspace_methods_of_several_channels(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 3);
        for (int method = OKID_METHOD_N4SID_MOESP; method <= OKID_METHOD_N4SID_SSARX; ++method)
            is_the_derivative((okid_method_t)method, rig.n_u);
    }
}

static void without_forces(void) {
    for (int which = 0; which < 2; ++which) {
        make(which, 1);
        for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method)
            if (method != OKID_METHOD_N4SID_MOESP) is_the_derivative((okid_method_t)method, 0);
    }
}

/// Of sums with nothing left out: the full model again.
static void nothing_left_out_is_the_whole(void) {
    make(0, 0.3);
    for (int method = OKID_METHOD_OKID_ERA; method <= OKID_METHOD_N4SID_SSARX; ++method) {
        setting_t s = prepare((okid_method_t)method, rig.n_u);
        const printed_t whole = identified(&s, s.whole);
        okid_jackknife_config_t by_models = s.config;
        by_models.linear = 0;
        const size_t bytes = okid_jackknife_memsize(&by_models);
        void* block = malloc(bytes);
        okid_jackknife_t* jackknife = NULL;
        okid_model_t model;
        double share = -1;
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&jackknife, &by_models, block, bytes));
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin(jackknife, s.whole, &s.full));
        TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(jackknife, NULL, 1, &model, &share));
        TEST_ASSERT_EQUAL_DOUBLE(0, share);
        const printed_t again = print_model(&model);
        const double most = TOLERANCE(1e-4, 1e-2); // okid-era starts from the model, and comes near it
        for (int k = 0; k < 2 * WIDE_MODES; ++k) TEST_ASSERT_DOUBLE_WITHIN(most, whole.modes[k], again.modes[k]);
        for (int k = 0; k < BLOCKS * rig.n_u * rig.n_y; ++k)
            TEST_ASSERT_DOUBLE_WITHIN(10 * most, whole.markov[k], again.markov[k]);
        free(block);
        release(&s);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(okid_of_several_channels);
    RUN_TEST(subspace_methods_of_several_channels);
    RUN_TEST(without_forces);
    RUN_TEST(nothing_left_out_is_the_whole);
    return UNITY_END();
}
