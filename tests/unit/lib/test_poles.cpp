// SPDX-License-Identifier: MIT
// Logarithms of poles and the functions of the holds beside long double.
#include "mechanics/poles.hpp"

extern "C" {
#include <unity.h>
}
#include <cmath>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using complex = std::complex<double>;
using wide = std::complex<long double>;

/// log |mu| from |mu|^2 - 1 without cancellation of more than long double has.
long double size_of_log(complex mu) {
    const long double x = std::abs(mu.real()), y = std::abs(mu.imag()), big = std::fmax(x, y), small = std::fmin(x, y);
    return std::log1p((big - 1) * (big + 1) + small * small) / 2;
}

void assert_close(wide expected, complex found, double relative) {
    TEST_ASSERT_TRUE(std::abs(wide(found) - expected) <= relative * std::abs(expected));
}

// Damping is the real part: beside the unit circle it keeps its digits where the poles of slow modes lie.
void the_logarithm_keeps_the_damping_of_slow_modes() {
    for (double less = 1e-15; less < 0.5; less *= 3)
        for (double angle = 1e-9; angle < 1e-3; angle *= 7)
            for (const bool turned : {false, true}) // at a quarter of the sampling rate too
                for (const double sign : {-1.0, 1.0}) {
                    const complex along((1 + sign * less) * std::cos(angle), (1 + sign * less) * std::sin(angle));
                    const complex mu = turned ? complex(along.imag(), along.real()) : along;
                    const long double expected = size_of_log(mu);
                    const double off = 1e-15 * (less + angle * angle); // not 1e-16, which is a rounding of |mu|
                    TEST_ASSERT_DOUBLE_WITHIN(off, static_cast<double>(expected), okid::logarithm(mu).real());
                }
}

void the_logarithm_of_any_pole() {
    for (double radius = 0.01; radius < 4; radius *= 1.07)
        for (double angle = -3.1; angle < 3.14; angle += 0.17) {
            const complex mu = std::polar(radius, angle);
            const complex found = okid::logarithm(mu);
            TEST_ASSERT_DOUBLE_WITHIN(4e-16 * (1 + std::abs(std::log(radius))), std::log(radius), found.real());
            TEST_ASSERT_DOUBLE_WITHIN(1e-15, angle, found.imag());
        }
}

/// sum of l^k / (k + first)!
wide series(wide l, int first) {
    wide term = 1, sum = 0;
    for (int k = 2; k <= first; ++k) term /= k;
    for (int k = 0; k < 60; ++k) {
        sum += term;
        term *= l / static_cast<long double>(k + first + 1);
    }
    return sum;
}

void the_functions_of_the_holds() {
    const double dt = 0.02;
    for (double size = 1e-12; size < 4; size *= 1.6)
        for (double angle = 0; angle < 6.28; angle += 0.4) {
            const complex l = std::polar(size, angle);
            const wide one = series(wide(l), 1), two = series(wide(l), 2);
            assert_close(one, okid::phi_1(l), 1e-14);
            assert_close(two, okid::phi_2(l), 1e-13);
            const wide step(dt);
            assert_close(wide(1) / (step * one), okid::hold_inverse(l, dt, OKID_HOLD_ZERO), 1e-13);
            assert_close(wide(1) / (step * one * one), okid::hold_inverse(l, dt, OKID_HOLD_FIRST), 1e-13);
            assert_close(two / (one * one), okid::hold_feed(l, OKID_HOLD_FIRST), 1e-12);
            TEST_ASSERT_TRUE(okid::hold_feed(l, OKID_HOLD_ZERO) == complex(0));
        }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(the_logarithm_keeps_the_damping_of_slow_modes);
    RUN_TEST(the_logarithm_of_any_pole);
    RUN_TEST(the_functions_of_the_holds);
    return UNITY_END();
}
