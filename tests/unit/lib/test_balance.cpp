// SPDX-License-Identifier: MIT
// Balanced states are the same matrix in other units, powers of two, and rows and columns of one size; the exponential
// of what can be written down.
#include "mechanics/exponential.hpp"

extern "C" {
#include <unity.h>
}
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using real = okid_real_t;
using matrix = std::vector<real>;

std::uint64_t state = 1;

double draw() {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state >> 11) / 4503599627370496.0 - 1;
}

/// In units of very different size; one state is cut off from the others in its row or its column.
matrix badly_scaled(int n, int alone, bool row) {
    std::vector<double> unit(static_cast<size_t>(n));
    for (double& one : unit) one = std::pow(10, 6 * draw());
    matrix a(static_cast<size_t>(n * n));
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const bool cut = i != j && (row ? i : j) == alone;
            a[static_cast<size_t>(j * n + i)] =
                cut ? real(0) : static_cast<real>(draw() * unit[static_cast<size_t>(i)] / unit[static_cast<size_t>(j)]);
        }
    return a;
}

/// Sizes of the column and the row of a state, without what is on the diagonal.
void sizes(int n, const matrix& a, int i, double& column, double& row) {
    column = row = 0;
    for (int j = 0; j < n; ++j) {
        if (j == i) continue;
        column += std::abs(double(a[static_cast<size_t>(i * n + j)]));
        row += std::abs(double(a[static_cast<size_t>(j * n + i)]));
    }
}

void the_same_matrix_in_units_that_are_powers_of_two() {
    for (int n = 1; n <= 9; ++n)
        for (int alone = -1; alone < n; ++alone)
            for (const bool row : {false, true}) {
                const matrix before = badly_scaled(n, alone, row);
                matrix a = before, d(static_cast<size_t>(n), real(-1));
                okid::balance(n, a.data(), d.data());
                for (int j = 0; j < n; ++j) {
                    int exponent = 0;
                    TEST_ASSERT_TRUE(std::frexp(double(d[static_cast<size_t>(j)]), &exponent) == 0.5);
                    for (int i = 0; i < n; ++i) {
                        const auto at = static_cast<size_t>(j * n + i);
                        TEST_ASSERT_TRUE(a[at] == before[at] * d[static_cast<size_t>(j)] / d[static_cast<size_t>(i)]);
                    }
                }
                // no power of two is left that takes more than a twentieth off
                for (int i = 0; i < n; ++i) {
                    double c = 0, r = 0;
                    sizes(n, a, i, c, r);
                    if (!(c > 0 && r > 0)) continue;
                    for (const double f : {0.25, 0.5, 2.0, 4.0}) TEST_ASSERT_TRUE(c * f + r / f >= 0.949 * (c + r));
                }
            }
}

void what_is_balanced_stays_as_it_is() {
    for (const double size : {1e-9, 1.0, 1e9}) {
        matrix a(16), d(4);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j)
                a[static_cast<size_t>(4 * j + i)] = static_cast<real>(size * (1 + 0.2 * ((i + j) % 2)));
        const matrix before = a;
        okid::balance(4, a.data(), d.data());
        TEST_ASSERT_TRUE(a == before);
        TEST_ASSERT_TRUE(d == matrix(4, real(1)));
    }
}

void numbers_that_are_none_are_left_alone() {
    const real infinite = std::numeric_limits<real>::infinity();
    matrix a = {1, infinite, 1000, 1}, d(2);
    const matrix before = a;
    okid::balance(2, a.data(), d.data());
    TEST_ASSERT_TRUE(a == before);
    matrix result(4), spare(4);
    TEST_ASSERT_FALSE(okid::exponential(2, a.data(), result.data(), spare.data()));
}

// A turn by any angle and any growth: e^[g -w; w g] = e^g [cos w, -sin w; sin w, cos w].
void the_exponential_of_a_turn() {
    for (double w = 0; w < 60; w = 1.7 * w + 0.01)
        for (double g = -3; g <= 3; g += 0.75) {
            matrix x = {static_cast<real>(g), static_cast<real>(w), static_cast<real>(-w), static_cast<real>(g)};
            matrix result(4), spare(4);
            TEST_ASSERT_TRUE(okid::exponential(2, x.data(), result.data(), spare.data()));
            const double c = std::exp(g) * std::cos(w), s = std::exp(g) * std::sin(w);
            const double off = 1e-14 * (1 + w) * std::exp(g);
            TEST_ASSERT_DOUBLE_WITHIN(off, c, result[0]);
            TEST_ASSERT_DOUBLE_WITHIN(off, s, result[1]);
            TEST_ASSERT_DOUBLE_WITHIN(off, -s, result[2]);
            TEST_ASSERT_DOUBLE_WITHIN(off, c, result[3]);
        }
}

void the_exponential_of_a_chain_of_integrators() {
    for (int n = 1; n <= 6; ++n)
        for (const double t : {0.25, 1.0, 3.0, 16.0}) {
            matrix x(static_cast<size_t>(n * n)), result(x), spare(x);
            for (int i = 0; i + 1 < n; ++i) x[static_cast<size_t>((i + 1) * n + i)] = static_cast<real>(t);
            TEST_ASSERT_TRUE(okid::exponential(n, x.data(), result.data(), spare.data()));
            for (int j = 0; j < n; ++j) {
                double term = 1; // t^k / k! on diagonal k
                for (int k = 0; k <= j; ++k) {
                    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * term, term, result[static_cast<size_t>(j * n + j - k)]);
                    term *= t / (k + 1);
                }
                for (int i = j + 1; i < n; ++i) TEST_ASSERT_EQUAL_DOUBLE(0, result[static_cast<size_t>(j * n + i)]);
            }
        }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(the_same_matrix_in_units_that_are_powers_of_two);
    RUN_TEST(what_is_balanced_stays_as_it_is);
    RUN_TEST(numbers_that_are_none_are_left_alone);
    RUN_TEST(the_exponential_of_a_turn);
    RUN_TEST(the_exponential_of_a_chain_of_integrators);
    return UNITY_END();
}
