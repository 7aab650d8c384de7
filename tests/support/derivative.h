// SPDX-License-Identifier: MIT
// The derivative of an identification along the sums of a part of its record: the objects that are needed, what does
// not depend on the states of a model, and how far a linear change is from a central difference.
#ifndef OKID_TEST_DERIVATIVE_H
#define OKID_TEST_DERIVATIVE_H

#include "wide_rig.h"

#include <okid/okid.h>
#include <unity.h>

enum { MARKOV = 8 };

/// Of the modes by frequency: frequencies (true ones 1), then damping ratios; shapes with the first output 1, all real
/// parts, then all imaginary ones; Y_0 .. Y_7.
typedef struct printed_t {
    double modes[2 * WIDE_MODES], shapes[2 * WIDE_MODES * WIDE_MOST], markov[MARKOV * WIDE_MOST * WIDE_MOST];
} printed_t;

typedef struct setting_t {
    const double* frequency_hz; ///< true ones, of as many modes as the order has room for
    okid_jackknife_config_t config;
    okid_accumulator_t *whole, *part;
    void* blocks[2];
    okid_identify_t* identify;
    okid_identified_t full;
    okid_jackknife_t* jackknife;
} setting_t;

static inline okid_accumulator_t* setting_sums(const setting_t* s) { // the block begins where the object does
    const size_t bytes = okid_accumulator_memsize(&s->config.sums);
    okid_accumulator_t* a = NULL;
    void* block = aligned_alloc(16, (bytes + 15) / 16 * 16);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&a, &s->config.sums, block, bytes));
    TEST_ASSERT_EQUAL_PTR(block, a);
    return a;
}

/// Sums of the whole and of a part, both empty, and what goes with them.
static inline setting_t setting_make(const okid_identify_config_t* identify, const double* frequency_hz) {
    setting_t s = {.frequency_hz = frequency_hz, .config = {.identify = *identify, .linear = 1}};
    s.config.sums = okid_accumulator_defaults(identify->n_u, identify->n_y, okid_identify_lags(identify));
    s.config.sums.edges = 1;
    s.whole = setting_sums(&s), s.part = setting_sums(&s);
    const size_t bytes = okid_identify_memsize(identify), more = okid_jackknife_memsize(&s.config);
    TEST_ASSERT_TRUE(more > 0);
    s.blocks[0] = malloc(bytes), s.blocks[1] = malloc(more);
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&s.identify, identify, s.blocks[0], bytes));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_jackknife_create(&s.jackknife, &s.config, s.blocks[1], more - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_create(&s.jackknife, &s.config, s.blocks[1], more));
    return s;
}

static inline void setting_free(setting_t* s) { free(s->whole), free(s->part), free(s->blocks[0]), free(s->blocks[1]); }

static inline printed_t print_model(const setting_t* s, const okid_model_t* model) {
    printed_t out = {0};
    okid_real_t f[WIDE_MODES], zeta[WIDE_MODES], re[WIDE_MODES * WIDE_MOST], im[WIDE_MODES * WIDE_MOST];
    const int n_y = model->n_y, count = model->n_z / 2;
    const size_t bytes = okid_modal_memsize(n_y, model->n_z);
    void* work = malloc(bytes);
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta, .shape_re = re, .shape_im = im};
    TEST_ASSERT_EQUAL(s->config.identify.order, model->n_z);
    TEST_ASSERT_EQUAL(OKID_OK, okid_modal_analyse(model, 1 / s->config.identify.fs_hz, &modes, work, bytes));
    free(work);
    TEST_ASSERT_EQUAL(count, modes.count);
    for (int k = 0; k < count; ++k) {
        out.modes[k] = (double)f[k] / s->frequency_hz[k];
        out.modes[count + k] = (double)zeta[k];
        const double a = (double)re[k * n_y], b = (double)im[k * n_y];
        for (int i = k * n_y; i < (k + 1) * n_y; ++i) {
            const double x = (double)re[i], y = (double)im[i];
            out.shapes[i] = (x * a + y * b) / (a * a + b * b);
            out.shapes[count * n_y + i] = (y * a - x * b) / (a * a + b * b);
        }
    }
    if (model->n_u > 0)
        wide_markov(model->n_u, n_y, model->n_z, model->A, model->B, model->C, model->D, MARKOV - 1, out.markov);
    return out;
}

static inline okid_model_t full_model(const setting_t* s) {
    const okid_identified_t* m = &s->full;
    const okid_model_t out = {m->n_u, m->n_y, m->n_z, m->A, m->B, m->C, m->D, NULL};
    return out;
}

static inline printed_t identified(setting_t* s, okid_accumulator_t* from) {
    TEST_ASSERT_GREATER_OR_EQUAL(OKID_OK, okid_identify_run(s->identify, from, &s->full));
    const okid_model_t model = full_model(s);
    return print_model(s, &model);
}

/// The model with the part left out, or with -1 taken twice.
static inline printed_t changed(setting_t* s, double weight, double* share) {
    okid_model_t model;
    TEST_ASSERT_EQUAL(OKID_OK, okid_jackknife_delete(s->jackknife, s->part, weight, &model, share));
    return print_model(s, &model);
}

/// Largest difference of the two changes, over the largest change; `scale` of the step down, that up is 1.
static inline double worst(const double* low, const double* high, const double* down, const double* up, double scale,
                           int n) {
    double difference = 0, largest = 0;
    for (int k = 0; k < n; ++k) {
        const double central = (high[k] - low[k]) / 2, linear = (up[k] - down[k]) / (1 + 1 / scale);
        difference = fmax(difference, fabs(linear - central));
        largest = fmax(largest, fabs(central));
    }
    return difference / largest;
}

#endif
