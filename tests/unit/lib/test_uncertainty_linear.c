// SPDX-License-Identifier: MIT
// The derivative of an identification along the sums of a part, against central differences of the identification itself:
// the record with the part twice, and without it. Nothing is shared with linear_*.cpp but the sums.
#include "modal_rig.h"
#include "tolerance.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <unity.h>

enum { P = 20, N = 6000, FIRST = 2000, LAST = 2030, MARKOV = 8 };

static rig_t rig;
static double *record, *outputs; // the same without the force

void setUp(void) {
    rig_make(&rig);
    record = rig_record(&rig, N, 0.05, NULL, 11);
    for (int n = 0; n < N; ++n) // offsets: the means of a part are not those of the whole
        for (int c = 0; c < RIG_M; ++c) record[n * RIG_M + c] += 3 + c;
    outputs = malloc(sizeof *outputs * N * RIG_NY);
    for (int n = 0; n < N; ++n) memcpy(outputs + n * RIG_NY, record + n * RIG_M + RIG_NU, RIG_NY * sizeof *outputs);
}
void tearDown(void) { free(record), free(outputs); }

/// Samples first .. last-1 of the record, or of its outputs alone.
static void feed(okid_accumulator_t* to, int n_u, int first, int last) {
    const double* from = n_u > 0 ? record + (size_t)first * RIG_M : outputs + (size_t)first * RIG_NY;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(to, from, (size_t)(last - first)));
}

/// What is printed of a model, whatever its states: modes by frequency, shapes with the first output 1, Y_0 .. Y_7.
typedef struct printed_t {
    double f[RIG_MODES], zeta[RIG_MODES], re[RIG_MODES * RIG_NY], im[RIG_MODES * RIG_NY], markov[MARKOV * RIG_NY];
} printed_t;

static printed_t print_model(const okid_model_t* model) {
    printed_t out;
    okid_real_t f[RIG_MODES], zeta[RIG_MODES], re[RIG_MODES * RIG_NY], im[RIG_MODES * RIG_NY];
    const size_t bytes = okid_modal_memsize(RIG_NY, model->n_z);
    void* work = malloc(bytes);
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta, .shape_re = re, .shape_im = im};
    TEST_ASSERT_EQUAL(RIG_NZ, model->n_z);
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(model, 1 / RIG_FS, &modes, work, bytes));
    TEST_ASSERT_EQUAL(RIG_MODES, modes.count);
    free(work);
    for (int k = 0; k < RIG_MODES; ++k) {
        out.f[k] = f[k], out.zeta[k] = zeta[k];
        const double a = re[k * RIG_NY], b = im[k * RIG_NY];
        for (int o = 0; o < RIG_NY; ++o) {
            const double x = re[k * RIG_NY + o], y = im[k * RIG_NY + o];
            out.re[k * RIG_NY + o] = (x * a + y * b) / (a * a + b * b);
            out.im[k * RIG_NY + o] = (y * a - x * b) / (a * a + b * b);
        }
    }
    double state[RIG_NZ], next[RIG_NZ];
    if (model->n_u == 0) return out;
    for (int i = 0; i < RIG_NZ; ++i) state[i] = model->B[i];
    for (int o = 0; o < RIG_NY; ++o) out.markov[o] = model->D[o];
    for (int k = 1; k < MARKOV; ++k) {
        for (int o = 0; o < RIG_NY; ++o) {
            out.markov[k * RIG_NY + o] = 0;
            for (int i = 0; i < RIG_NZ; ++i) out.markov[k * RIG_NY + o] += model->C[i * RIG_NY + o] * state[i];
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += model->A[j * RIG_NZ + i] * state[j];
        }
        memcpy(state, next, sizeof state);
    }
    return out;
}

static okid_accumulator_t* make(const okid_accumulator_config_t* config) { // the block begins where the object does
    const size_t bytes = okid_accumulator_memsize(config);
    okid_accumulator_t* a = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, config, aligned_alloc(16, (bytes + 15) / 16 * 16), bytes));
    return a;
}

typedef struct setting_t {
    okid_jackknife_config_t config;
    okid_accumulator_t *whole, *part;
    void* blocks[2];
    okid_identify_t* identify;
    okid_identified_t full;
    okid_jackknife_t* jackknife;
} setting_t;

static setting_t prepare(okid_method_t method, int n_u, okid_detrend_t detrend) {
    setting_t s = {.config = {.identify = {.n_u = n_u,
                                           .n_y = RIG_NY,
                                           .p = P,
                                           .order = RIG_NZ,
                                           .max_order = 8,
                                           .fs_hz = RIG_FS,
                                           .method = method,
                                           .detrend = detrend},
                              .linear = 1}};
    okid_identify_config_t* c = &s.config.identify;
    if (method >= OKID_METHOD_N4SID_MOESP) c->rows = P / 2, c->p = 0;
    s.config.sums = (okid_accumulator_config_t){.n_u = n_u,
                                                .n_y = RIG_NY,
                                                .lags = okid_identify_lags(c),
                                                .sample = OKID_SAMPLE_DOUBLE,
                                                .forgetting = 1,
                                                .edges = 1};
    const int lags = s.config.sums.lags;
    s.whole = make(&s.config.sums), s.part = make(&s.config.sums);
    feed(s.whole, n_u, 0, N);
    feed(s.part, n_u, FIRST - lags, LAST);
    const size_t bytes = okid_identify_memsize(c), more = okid_jackknife_memsize(&s.config);
    TEST_ASSERT_TRUE(more > 0);
    s.blocks[0] = malloc(bytes), s.blocks[1] = malloc(more);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s.identify, c, s.blocks[0], bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_jackknife_create(&s.jackknife, &s.config, s.blocks[1], more - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&s.jackknife, &s.config, s.blocks[1], more));
    return s;
}

static void release(setting_t* s) { free(s->whole), free(s->part), free(s->blocks[0]), free(s->blocks[1]); }

static printed_t identified(setting_t* s, okid_accumulator_t* from) {
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run(s->identify, from, &s->full));
    const okid_identified_t* m = &s->full;
    const okid_model_t model = {m->n_u, m->n_y, m->n_z, m->A, m->B, m->C, m->D, NULL};
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

static void the_change_is_the_derivative(void) {
    static const struct {
        okid_method_t method;
        int n_u;
    } cases[] = {{OKID_METHOD_OKID_ERA, RIG_NU},  {OKID_METHOD_OKID_ERA_DC, RIG_NU}, {OKID_METHOD_N4SID_MOESP, RIG_NU},
                 {OKID_METHOD_N4SID_CVA, RIG_NU}, {OKID_METHOD_N4SID_SSARX, RIG_NU}, {OKID_METHOD_N4SID_CVA, 0},
                 {OKID_METHOD_N4SID_SSARX, 0},    {OKID_METHOD_OKID_ERA, 0},         {OKID_METHOD_OKID_ERA_DC, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
        for (okid_detrend_t detrend = OKID_DETREND_NONE; detrend <= OKID_DETREND_MEAN; ++detrend) {
            if (detrend == OKID_DETREND_NONE)
                for (int n = 0; n < N * RIG_M; ++n) record[n] -= 3 + n % RIG_M;
            for (int n = 0; detrend == OKID_DETREND_NONE && n < N * RIG_NY; ++n) outputs[n] -= 4 + n % RIG_NY;
            setting_t s = prepare(cases[i].method, cases[i].n_u, detrend);
            okid_accumulator_t *more = make(&s.config.sums), *less = make(&s.config.sums);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(more, s.whole));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(more, s.part));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_copy(less, s.whole));
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(less, s.part, 1));
            const printed_t low = identified(&s, less), high = identified(&s, more);
            identified(&s, s.whole);
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
            okid_model_t model;
            double share = 0;
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, 1, &model, &share));
            const printed_t down = print_model(&model);
            const double scale = 1 - share; // the rest is smaller: what it says weighs more
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, -1, &model, &share));
            const printed_t up = print_model(&model);
            const double errors[] = {
                worst(low.f, high.f, down.f, up.f, scale, RIG_MODES),
                worst(low.zeta, high.zeta, down.zeta, up.zeta, scale, RIG_MODES),
                worst(low.re, high.re, down.re, up.re, scale, RIG_MODES * RIG_NY),
                worst(low.im, high.im, down.im, up.im, scale, RIG_MODES * RIG_NY),
                worst(low.markov, high.markov, down.markov, up.markov, scale, MARKOV * RIG_NY),
            };
            const int inputs_stay =
                cases[i].method == OKID_METHOD_N4SID_MOESP || cases[i].method == OKID_METHOD_N4SID_CVA;
            const int kinds = inputs_stay || cases[i].n_u == 0 ? 4 : 5;
            for (int k = 0; k < kinds; ++k) TEST_ASSERT_TRUE(errors[k] < TOLERANCE(0.01, 0.5)); // step: 1 part in 200
            free(more), free(less);
            release(&s);
            if (detrend == OKID_DETREND_NONE)
                for (int n = 0; n < N * RIG_M; ++n) record[n] += 3 + n % RIG_M;
            for (int n = 0; detrend == OKID_DETREND_NONE && n < N * RIG_NY; ++n) outputs[n] += 4 + n % RIG_NY;
        }
}

/// Deviations of ten equal parts by derivatives and by identification without each are the same to a tenth.
static void deviations_are_those_of_the_jackknife(void) {
    enum { PARTS = 10 };
    static const okid_method_t methods[] = {OKID_METHOD_OKID_ERA, OKID_METHOD_N4SID_MOESP, OKID_METHOD_N4SID_CVA};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; ++i) {
        setting_t s = prepare(methods[i], RIG_NU, OKID_DETREND_MEAN);
        const int lags = s.config.sums.lags;
        identified(&s, s.whole);
        const okid_identified_t* m = &s.full;
        const okid_model_t full = {m->n_u, m->n_y, m->n_z, m->A, m->B, m->C, m->D, NULL};
        const okid_replicates_config_t modes_only = okid_replicates_defaults(RIG_NU, RIG_NY, 8);
        double found[2][2 * RIG_MODES];
        for (int linear = 0; linear < 2; ++linear) {
            s.config.linear = linear;
            const size_t bytes = okid_jackknife_memsize(&s.config), size = okid_replicates_memsize(&modes_only);
            void *block = malloc(bytes), *sums = malloc(size);
            okid_replicates_t* replicates = NULL;
            TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&s.jackknife, &s.config, block, bytes));
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_create(&replicates, &modes_only, sums, size));
            TEST_ASSERT_EQUAL(OKID_OK, linear ? okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full)
                                              : okid_jackknife_begin(s.jackknife, s.whole, &s.full));
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_begin(replicates, &full, 1 / RIG_FS));
            for (int k = 0; k < PARTS; ++k) {
                const int first = lags + k * (N - lags) / PARTS, last = lags + (k + 1) * (N - lags) / PARTS;
                okid_accumulator_reset(s.part);
                feed(s.part, RIG_NU, first - lags, last);
                okid_model_t model;
                double share = 0;
                TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, 1, &model, &share));
                TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_add(replicates, &model, share));
            }
            okid_uncertainty_t out;
            TEST_ASSERT_EQUAL(OKID_OK, okid_replicates_finish(replicates, &out));
            for (int k = 0; k < RIG_MODES; ++k) {
                found[linear][k] = out.frequency_std_hz[k];
                found[linear][RIG_MODES + k] = out.damping_ratio_std[k];
            }
            free(block), free(sums);
        }
        for (int k = 0; k < 2 * RIG_MODES; ++k) TEST_ASSERT_TRUE(fabs(found[1][k] / found[0][k] - 1) < 0.1);
        release(&s);
    }
}

/// A part with a gap in it goes another way to its Gram matrix.
static void a_gap_changes_nothing(void) {
    setting_t s = prepare(OKID_METHOD_N4SID_CVA, RIG_NU, OKID_DETREND_MEAN);
    const int lags = s.config.sums.lags, middle = (FIRST + LAST) / 2;
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    okid_model_t model;
    double share = 0;
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, 1, &model, &share));
    const printed_t one = print_model(&model);
    okid_accumulator_reset(s.part);
    feed(s.part, RIG_NU, FIRST - lags, middle);
    okid_accumulator_gap(s.part, 0);
    feed(s.part, RIG_NU, middle - lags, LAST);
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s.jackknife, s.part, 1, &model, &share));
    const printed_t other = print_model(&model);
    for (int k = 0; k < RIG_MODES; ++k) {
        const double limit = TOLERANCE(1e-9, 1e-4);
        TEST_ASSERT_TRUE(fabs(other.f[k] / one.f[k] - 1) < limit);
        TEST_ASSERT_TRUE(fabs(other.zeta[k] / one.zeta[k] - 1) < 100 * limit);
    }
    release(&s);
}

static void what_has_no_derivative_is_refused(void) {
    setting_t s = prepare(OKID_METHOD_OKID_ERA, RIG_NU, OKID_DETREND_MEAN);
    identified(&s, s.whole);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_jackknife_begin(s.jackknife, s.whole, &s.full));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_jackknife_begin_linear(s.jackknife, NULL, s.whole, &s.full));
    okid_identified_t larger = s.full;
    larger.n_z = 100;
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &larger));
    okid_square_root_config_t shape = {.n_u = RIG_NU, .n_y = RIG_NY, .lags = P, .forgetting = 1};
    const size_t bytes = okid_square_root_memsize(&shape);
    void* block = malloc(bytes);
    okid_square_root_t* factor = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&factor, &shape, block, bytes));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(factor, record, N));
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run_factor(s.identify, factor, &s.full));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_jackknife_begin_linear(s.jackknife, s.identify, s.whole, &s.full));
    free(block);
    okid_jackknife_config_t none = s.config;
    none.identify.hankel = OKID_HANKEL_INNOVATIONS;
    TEST_ASSERT_EQUAL(0, okid_jackknife_memsize(&none));
    release(&s);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(the_change_is_the_derivative);
    RUN_TEST(deviations_are_those_of_the_jackknife);
    RUN_TEST(a_gap_changes_nothing);
    RUN_TEST(what_has_no_derivative_is_refused);
    return UNITY_END();
}
