// SPDX-License-Identifier: MIT
// The modal rig with both kernels and an identifier of one shape, for tests of whole identifications.
#ifndef IDENTIFY_BENCH_H
#define IDENTIFY_BENCH_H

#include "modal_rig.h"

#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <unity.h>

static rig_t rig;
static void* blocks[3];
static okid_accumulator_t* accumulator;
static okid_square_root_t* square_root;
static okid_identify_t* identifier;
static okid_identified_t model;

void setUp(void) { rig_make(&rig); }

void tearDown(void) {
    for (int k = 0; k < 3; ++k) {
        free(blocks[k]);
        blocks[k] = NULL;
    }
}

/// Anew in memory of exactly the size asked for, with one byte less refused.
static void create(const okid_identify_config_t* config) {
    const int lags = okid_identify_lags(config);
    const okid_accumulator_config_t a = {
        .n_u = config->n_u, .n_y = config->n_y, .lags = lags, .forgetting = 1, .edges = 1};
    const okid_square_root_config_t q = {.n_u = config->n_u, .n_y = config->n_y, .lags = lags, .forgetting = 1};
    const size_t bytes[3] = {okid_accumulator_memsize(&a), okid_identify_memsize(config), okid_square_root_memsize(&q)};
    tearDown();
    for (int k = 0; k < 3; ++k) {
        TEST_ASSERT_GREATER_THAN(0, bytes[k]);
        blocks[k] = malloc(bytes[k]);
    }
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&accumulator, &a, blocks[0], bytes[0]));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_identify_create(&identifier, config, blocks[1], bytes[1] - 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_identify_create(&identifier, config, blocks[1], bytes[1]));
    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&square_root, &q, blocks[2], bytes[2]));
}

#endif
