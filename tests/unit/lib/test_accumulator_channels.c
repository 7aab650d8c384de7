// SPDX-License-Identifier: MIT
// An output struck out of sums: they are those of the other channels alone, in every kind of accumulator, and go on as those do.
#include "same_sums.h"

#include <math.h>
#include <okid/accumulator.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

enum { INPUTS = 2, OUTPUTS = 4, ALL = INPUTS + OUTPUTS, KEPT = 4, LAGS = 5, COUNT = 900, WIDE = KEPT * (LAGS + 1) };

static const int32_t channels[KEPT] = {0, 1, 2, 5};
static int32_t codes[COUNT * ALL];
static void* blocks[64];
static int made;

void setUp(void) {
    uint32_t state = 7;
    for (int i = 0; i < COUNT * ALL; ++i) {
        state = state * 1664525u + 1013904223u;
        codes[i] = (int32_t)(state >> 16) % 2000 - 1000 + 40 * (i % ALL);
    }
}
void tearDown(void) {
    while (made > 0) free(blocks[--made]);
}

static okid_accumulator_t* make(okid_accumulator_config_t config, int outputs) {
    config.n_u = INPUTS;
    config.n_y = outputs;
    const size_t bytes = okid_accumulator_memsize(&config);
    TEST_ASSERT_LESS_THAN(64, made);
    blocks[made] = malloc(bytes);
    okid_accumulator_t* out = NULL;
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&out, &config, blocks[made++], bytes));
    return out;
}

/// Samples of all channels, or of those that are kept.
static void feed(okid_accumulator_t* to, okid_sample_t sample, int kept, int first, int last) {
    const int m = kept ? KEPT : ALL;
    for (int n = first; n < last; ++n) {
        int32_t row[ALL];
        int16_t words[ALL];
        double numbers[ALL];
        for (int c = 0; c < m; ++c) {
            row[c] = codes[n * ALL + (kept ? channels[c] : c)];
            words[c] = (int16_t)row[c];
            numbers[c] = row[c] / 64.0; // their products have room in a double: sums in any order are the same bits
        }
        const okid_status_t status = sample == OKID_SAMPLE_DOUBLE  ? okid_accumulator_add(to, numbers, 1)
                                     : sample == OKID_SAMPLE_INT16 ? okid_accumulator_add_i16(to, words, 1)
                                                                   : okid_accumulator_add_i32(to, row, 1);
        TEST_ASSERT_EQUAL(OKID_OK, status);
    }
}

static void feed_pieces(okid_accumulator_t* to, okid_sample_t sample, int kept, int paired) {
    feed(to, sample, kept, 0, 300);
    okid_accumulator_gap(to, 3);
    feed(to, sample, kept, 310, 450);
    if (paired) TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_pair_slots(to));
    feed(to, sample, kept, 450, 700);
}

static void same(okid_accumulator_t* a, okid_accumulator_t* b) {
    same_sums(a, b, WIDE);
    TEST_ASSERT_EQUAL_INT(okid_accumulator_slots(a), okid_accumulator_slots(b));
}

/// Growing, with a window, forgetting; doubles and codes.
static void it_is_what_the_others_alone_would_give(void) {
    const okid_sample_t samples[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};
    const okid_accumulator_config_t kinds[] = {
        {.lags = LAGS, .forgetting = 1, .edges = 1},
        {.lags = LAGS, .forgetting = 1, .block = 50, .slots = 12, .spare_slots = 3},
        {.lags = LAGS, .forgetting = 0.5, .block = 64, .edges = 1, .buffer = 1},
    };
    for (size_t s = 0; s < 4; ++s)
        for (size_t k = 0; k < 3; ++k) {
            okid_accumulator_config_t config = kinds[k];
            config.sample = samples[s];
            okid_accumulator_t *all = make(config, OUTPUTS), *alone = make(config, KEPT - INPUTS),
                               *taken = make(config, KEPT - INPUTS);
            const double units[2 * ALL] = {2, 3, 4, 5, 6, 7, 1, 1, 2, 2, 3, 3};
            const double own[2 * KEPT] = {2, 3, 4, 7, 1, 1, 2, 3};
            okid_accumulator_set_units(all, units, units + ALL);
            okid_accumulator_set_units(alone, own, own + KEPT);
            feed(taken, config.sample, 1, 700, 800); // what it held is dropped
            feed_pieces(all, config.sample, 0, config.slots > 0);
            feed_pieces(alone, config.sample, 1, config.slots > 0);
            TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_take_channels(taken, all, channels));
            same(taken, alone);
            feed(taken, config.sample, 1, 700, COUNT);
            feed(alone, config.sample, 1, 700, COUNT);
            same(taken, alone);
        }
}

static void what_does_not_fit_is_refused(void) {
    const okid_accumulator_config_t config = {.lags = LAGS, .forgetting = 1, .edges = 1};
    okid_accumulator_config_t longer = config;
    longer.lags = LAGS + 1;
    okid_accumulator_t *all = make(config, OUTPUTS), *taken = make(config, KEPT - INPUTS);
    const int32_t twice[KEPT] = {0, 1, 2, 2}, beyond[KEPT] = {0, 1, 2, ALL}, swapped[KEPT] = {1, 0, 2, 3},
                  input[KEPT] = {0, 2, 3, 4}, below[KEPT] = {-1, 1, 2, 3};
    const int32_t* const wrong[] = {twice, beyond, swapped, input, below};
    for (size_t k = 0; k < 5; ++k)
        TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_accumulator_take_channels(taken, all, wrong[k]));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_take_channels(make(longer, 2), all, channels));
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_accumulator_take_channels(all, all, channels));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_take_channels(NULL, all, channels));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_take_channels(taken, NULL, channels));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_accumulator_take_channels(taken, all, NULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(it_is_what_the_others_alone_would_give);
    RUN_TEST(what_does_not_fit_is_refused);
    return UNITY_END();
}
