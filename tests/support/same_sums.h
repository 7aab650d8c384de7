// SPDX-License-Identifier: MIT
// Do two accumulators hold the same, bit for bit?
#ifndef SAME_SUMS_H
#define SAME_SUMS_H
#include <okid/accumulator.h>
#include <stdlib.h>
#include <unity.h>

/// Gram matrices of `width` x `width` numbers with and without means, and the counts.
static void same_sums(okid_accumulator_t* a, okid_accumulator_t* b, size_t width) {
    double *one = calloc(width * width, sizeof *one), *other = calloc(width * width, sizeof *other);
    okid_accumulator_stats_t its, others;
    for (int detrend = 0; detrend < 2; ++detrend) {
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a, (okid_detrend_t)detrend, one, NULL));
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(b, (okid_detrend_t)detrend, other, NULL));
        TEST_ASSERT_EQUAL_MEMORY(one, other, width * width * sizeof *one);
    }
    okid_accumulator_stats(a, &its);
    okid_accumulator_stats(b, &others);
    TEST_ASSERT_EQUAL_MEMORY(&its, &others, sizeof its);
    free(one);
    free(other);
}
#endif
