// SPDX-License-Identifier: MIT
// The rules of the automatic order on numbers made for them: the largest gap, what a set of modes is worth, and the
// smallest order that comes near the best.
#include "identify/order.hpp"

#include <cmath>

extern "C" {
#include <unity.h>
void setUp(void) {}
void tearDown(void) {}
}

using okid::consistency_score;
using okid::order_by_gap;
using okid::order_by_score;

static void nine_tenths_of_the_best_score_are_enough() {
    const okid_real_t below[] = {okid_real_t(0.6), okid_real_t(1.79), okid_real_t(2.0)};
    TEST_ASSERT_EQUAL(6, order_by_score(below, 3));
    const okid_real_t above[] = {okid_real_t(0.6), okid_real_t(1.81), okid_real_t(2.0)};
    TEST_ASSERT_EQUAL(4, order_by_score(above, 3));
    const okid_real_t first[] = {okid_real_t(0.95), okid_real_t(0.2), okid_real_t(1.0), okid_real_t(0.99)};
    TEST_ASSERT_EQUAL(2, order_by_score(first, 4));
    const okid_real_t small[] = {0, okid_real_t(1e-3), 0};
    TEST_ASSERT_EQUAL(4, order_by_score(small, 3));
}

static void models_that_score_nothing_give_no_order() {
    const okid_real_t none[] = {0, 0, 0, 0};
    TEST_ASSERT_EQUAL(0, order_by_score(none, 4));
}

static void modes_are_worth_the_fourth_power_above_one_half() {
    const okid_real_t emac[] = {1, okid_real_t(0.75), okid_real_t(0.5), okid_real_t(0.25), 0};
    TEST_ASSERT_DOUBLE_WITHIN(0, 1, double(consistency_score(emac, 1)));
    TEST_ASSERT_DOUBLE_WITHIN(0, 1 + 1.0 / 16, double(consistency_score(emac, 2)));
    TEST_ASSERT_DOUBLE_WITHIN(0, 1 + 1.0 / 16,
                              double(consistency_score(emac, 5))); // less than one half is worth nothing
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, double(consistency_score(emac, 0)));
}

/// Powers of two: the ratios are exact.
static void the_largest_gap_behind_an_even_order_is_taken() {
    const okid_real_t values[] = {64, 32, 16, okid_real_t(0.5), okid_real_t(0.25), okid_real_t(0.125)};
    const okid::gap_choice odd = order_by_gap(values, 6, 6); // 32 behind order 3 does not count
    TEST_ASSERT_EQUAL(2, odd.order);
    TEST_ASSERT_DOUBLE_WITHIN(0, 2, odd.ratio);
    const okid_real_t even[] = {64, 32, 16, 8, okid_real_t(0.5), okid_real_t(0.25)};
    const okid::gap_choice four = order_by_gap(even, 6, 6);
    TEST_ASSERT_EQUAL(4, four.order);
    TEST_ASSERT_DOUBLE_WITHIN(0, 16, four.ratio);
    TEST_ASSERT_EQUAL(2, order_by_gap(even, 6, 3).order); // no order beyond the largest
    TEST_ASSERT_EQUAL(4, order_by_gap(even, 5, 6).order);
    TEST_ASSERT_EQUAL(2, order_by_gap(even, 4, 6).order); // nor one without a value behind it
}

static void gaps_in_rounding_do_not_count() {
    const okid_real_t values[] = {1, okid_real_t(0.5), okid_real_t(1e-20), okid_real_t(1e-20), okid_real_t(1e-30), 0};
    TEST_ASSERT_EQUAL(2, order_by_gap(values, 6, 4).order);
}

/// Units change no order, all values larger or smaller by the same: a slow fall into rounding ends in no gap.
static void only_ratios_of_values_count() {
    constexpr int count = 32;
    const double scales[] = {1e-6, 1, 1e6};
    for (const double scale : scales) {
        okid_real_t values[count] = {};
        values[0] = values[1] = static_cast<okid_real_t>(scale);
        for (int k = 2; k < 30; ++k) values[k] = static_cast<okid_real_t>(scale * 0.1 * std::pow(10, (2 - k) * 0.46));
        TEST_ASSERT_EQUAL(2, order_by_gap(values, count, count).order); // the last of them is 1e-14 of the first
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 10, order_by_gap(values, count, count).ratio);
    }
}

static void one_state_is_all_there_is_room_for() {
    const okid_real_t values[] = {1, okid_real_t(0.5)};
    TEST_ASSERT_EQUAL(1, order_by_gap(values, 2, 1).order);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, order_by_gap(values, 2, 1).ratio);
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(nine_tenths_of_the_best_score_are_enough);
    RUN_TEST(models_that_score_nothing_give_no_order);
    RUN_TEST(modes_are_worth_the_fourth_power_above_one_half);
    RUN_TEST(the_largest_gap_behind_an_even_order_is_taken);
    RUN_TEST(gaps_in_rounding_do_not_count);
    RUN_TEST(only_ratios_of_values_count);
    RUN_TEST(one_state_is_all_there_is_room_for);
    return UNITY_END();
}
