// SPDX-License-Identifier: MIT
// Ten digits beside what printf() writes: powers of ten and their neighbours, halves, codes times a scale, any size.
#include "files/decimal_text.hpp"

#include <cmath>
#include <cstdio>
#include <random>
#include <unity.h>

using namespace okid_host;

void setUp(void) {}
void tearDown(void) {}

namespace {

void check(double value) {
    char expected[40];
    std::snprintf(expected, sizeof expected, "%.10g", value);
    std::string text = "x";
    append_ten_digits(text, value);
    TEST_ASSERT_EQUAL_STRING(expected, text.c_str() + 1);
}

void check_both(double value) {
    check(value);
    check(-value);
}

void test_edges() {
    check_both(0);
    check(INFINITY);
    for (int exponent = -12; exponent <= 18; ++exponent)
        for (const double head : {1.0, 9.999999999, 9.9999999995, 9.99999999949999, 1.5, 1.0000000005, 1.2345678905}) {
            const double value = head * std::pow(10.0, exponent);
            check_both(value);
            check_both(std::nextafter(value, 0));
            check_both(std::nextafter(value, HUGE_VAL));
        }
}

void test_halves() {
    for (int n = 0; n < 20000; ++n) check_both(1000000000 + 0.5 + n); // binary halves, which round to even
    for (int n = 0; n < 20000; ++n) check_both((100000 + n) / 64.0);
}

void test_codes() {
    for (int code = -32768; code < 32768; ++code) {
        check(code);
        check(code * 0.000244140625);
        check(code * 9.80665 / 16384 - 1.25);
    }
}

void test_any() {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> exponent(-6, 12), head(1, 10);
    for (int n = 0; n < 400000; ++n) check_both(head(random) * std::pow(10.0, std::floor(exponent(random))));
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_edges);
    RUN_TEST(test_halves);
    RUN_TEST(test_codes);
    RUN_TEST(test_any);
    return UNITY_END();
}
