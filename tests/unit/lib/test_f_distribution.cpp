// SPDX-License-Identifier: MIT
// The tail of the F distribution against closed forms and tables.
#include "identify/f_distribution.hpp"

#include <initializer_list>
#include <math.h>

extern "C" {
#include <unity.h>
void setUp(void) {}
void tearDown(void) {}
}

using okid::f_upper_tail;

/// a = 2: P(F > x) = (1 + 2 x / b)^(-b/2); a = b = 1: 1 - 2/pi atan(sqrt(x)).
static void closed_forms() {
    for (const double x : {0.01, 0.5, 1.0, 4.0, 250.0})
        for (const double b : {1.5, 7.0, 33.3, 5000.0}) {
            const double tail = pow(1 + 2 * x / b, -b / 2);
            TEST_ASSERT_DOUBLE_WITHIN(1e-10 * tail, tail, f_upper_tail(x, 2, b));
        }
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, f_upper_tail(1, 1, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1 - 2 / 3.14159265358979324 * atan(3.0), f_upper_tail(9, 1, 1));
}

/// Upper 5 % and 1 % points as they stand in tables (three decimals).
static void table() {
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, 0.05, f_upper_tail(3.708, 3, 10));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.01, f_upper_tail(3.473, 6, 30));
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, 0.05, f_upper_tail(4.351, 1, 20));
}

static void limits() {
    TEST_ASSERT_EQUAL_DOUBLE(1, f_upper_tail(0, 3, 4));
    TEST_ASSERT_TRUE(isnan(f_upper_tail(1, 0, 4)));
    TEST_ASSERT_TRUE(isnan(f_upper_tail(NAN, 3, 4)));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(closed_forms);
    RUN_TEST(table);
    RUN_TEST(limits);
    return UNITY_END();
}
