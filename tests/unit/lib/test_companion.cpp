// SPDX-License-Identifier: MIT
// The radius of an ARX model against roots it was made of: outputs that each have a polynomial of their own, seen
// through a rotation of the outputs. Dense up to 64 states, by Arnoldi beyond.
#include "identify/companion.hpp"
#include "tolerance.h"

#include <cmath>
#include <cstdlib>
#include <vector>

extern "C" {
#include <unity.h>
void setUp(void) {}
void tearDown(void) {}
}

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double dense_limit = TOLERANCE(1e-10, 2e-5), arnoldi_limit = TOLERANCE(1e-6, 3e-5);
constexpr double own_units[8] = {1, 1, 1, 1, 1, 1, 1, 1};

/// theta of n_u inputs, whose columns hold what must not be read, and n_y outputs with pairs of roots: `radius(output,
/// pair)` at angles spread evenly over the half circle, where a polynomial is not sensitive to rounding. An odd p has a
/// root at 0.
template <class Radius> std::vector<okid_real_t> arx(int n_u, int n_y, int p, Radius radius) {
    std::vector<double> own(static_cast<std::size_t>(n_y * (p + 1))), turned(static_cast<std::size_t>(n_y * n_y));
    for (int o = 0; o < n_y; ++o) {
        double* c = own.data() + o * (p + 1);
        c[0] = 1;
        for (int k = 0; k < p / 2; ++k) {
            const double r = radius(o, k), angle = pi * (k + 0.5 + 0.06 * o) / (p / 2);
            for (int i = 2 * k + 2; i >= 1; --i)
                c[i] += -2 * r * std::cos(angle) * c[i - 1] + (i > 1 ? r * r * c[i - 2] : 0);
        }
    }
    for (int r = 0; r < n_y; ++r) // I - 2 v v^T / v^T v with v of ones
        for (int c = 0; c < n_y; ++c) turned[static_cast<std::size_t>(c * n_y + r)] = (r == c ? 1 : 0) - 2.0 / n_y;
    const int m = n_u + n_y;
    std::vector<okid_real_t> theta(static_cast<std::size_t>(n_y * (n_u + p * m)), okid_real_t(1e6));
    for (int h = 1; h <= p; ++h)
        for (int c = 0; c < n_y; ++c)
            for (int r = 0; r < n_y; ++r) {
                double sum = 0;
                for (int o = 0; o < n_y; ++o)
                    sum -= turned[static_cast<std::size_t>(o * n_y + r)] *
                           own[static_cast<std::size_t>(o * (p + 1) + h)] *
                           turned[static_cast<std::size_t>(c * n_y + o)];
                theta[static_cast<std::size_t>((n_u + (h - 1) * m + n_u + c) * n_y + r)] =
                    static_cast<okid_real_t>(sum);
            }
    return theta;
}

double radius_of(int n_u, int n_y, int p, const std::vector<okid_real_t>& theta, const double* scale = own_units,
                 bool growth_alone = false) {
    okid::companion_work work{};
    okid::arena counting;
    work.lay_out(n_y, p, counting);
    void* block = std::malloc(counting.bytes());
    okid::arena memory(block);
    work.lay_out(n_y, p, memory);
    const double radius = okid::companion_radius(n_u, n_y, p, theta.data(), scale, growth_alone, work);
    std::free(block);
    return radius;
}

/// Different for every pair, 0.98 the largest.
double ordinary(int output, int pair) { return 0.98 - 0.02 * output - 0.011 * ((pair * 7) % 10); }
/// Twelve pairs within a thousandth of the largest, 0.999: only a search that keeps pairs of them tells them apart.
double crowded(int output, int pair) {
    const int place = 10 * output + pair;
    return place % 4 == 1 && place < 48 ? 0.999 - 8e-5 * (place / 4) : 0.97 - 0.003 * (place % 10);
}

} // namespace

static void the_radius_is_that_of_the_largest_root() {
    const int sizes[][3] = {{1, 1, 2}, {2, 3, 7}, {1, 4, 16}, {3, 2, 32}}; // the last two have 64 states
    for (const auto& s : sizes)
        TEST_ASSERT_DOUBLE_WITHIN(dense_limit, 0.98, radius_of(s[0], s[1], s[2], arx(s[0], s[1], s[2], ordinary)));
    const int large[][3] = {{1, 5, 13}, {2, 5, 20}, {1, 6, 30}}; // 65 states and more
    for (const auto& s : large)
        TEST_ASSERT_DOUBLE_WITHIN(arnoldi_limit, 0.98, radius_of(s[0], s[1], s[2], arx(s[0], s[1], s[2], ordinary)));
}

static void a_crowd_of_roots_near_the_largest_is_told_apart() {
    for (int p = 14; p <= 20; p += 2)
        TEST_ASSERT_DOUBLE_WITHIN(arnoldi_limit, 0.999, radius_of(1, 5, p, arx(1, 5, p, crowded)));
}

static void a_root_outside_the_circle_is_growth() {
    const auto growing = [](int output, int pair) { return output == 1 && pair == 2 ? 1.05 : ordinary(output, pair); };
    for (int p = 10; p <= 30; p += 20) {
        TEST_ASSERT_DOUBLE_WITHIN(p == 10 ? dense_limit : 1e-3, 1.05, radius_of(1, 5, p, arx(1, 5, p, growing)));
        TEST_ASSERT_DOUBLE_WITHIN(p == 10 ? dense_limit : 1e-3, 1.05,
                                  radius_of(1, 5, p, arx(1, 5, p, growing), own_units, true));
    }
}

static void growth_alone_gives_no_radius_beyond_64_states() {
    TEST_ASSERT_DOUBLE_WITHIN(dense_limit, 0.98, radius_of(1, 4, 16, arx(1, 4, 16, ordinary), own_units, true));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, radius_of(1, 5, 13, arx(1, 5, 13, ordinary), own_units, true));
}

/// A far smaller unit makes huge entries of a theta, and a response in it that first grows.
static void what_grows_in_one_unit_only_does_not_count() {
    constexpr double unit = TOLERANCE(1e-4, 1e-2), limit = TOLERANCE(1e-5, 1e-2);
    const double small[5] = {1, unit, 1, 1, 1};
    for (int p = 10; p <= 20; p += 10) {
        std::vector<okid_real_t> theta = arx(1, 5, p, ordinary);
        TEST_ASSERT_DOUBLE_WITHIN(limit, 0.98, radius_of(1, 5, p, theta, small)); // fine as the outputs are
        for (std::size_t h = 0; h < static_cast<std::size_t>(p); ++h) // output 1 in the small unit: fine by scale
            for (std::size_t k = 0; k < 5; ++k) {
                theta[(1 + h * 6 + 1 + k) * 5 + 1] /= okid_real_t(unit);
                theta[(1 + h * 6 + 1 + 1) * 5 + k] *= okid_real_t(unit);
            }
        TEST_ASSERT_DOUBLE_WITHIN(limit, 0.98, radius_of(1, 5, p, theta, small));
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(the_radius_is_that_of_the_largest_root);
    RUN_TEST(a_crowd_of_roots_near_the_largest_is_told_apart);
    RUN_TEST(a_root_outside_the_circle_is_growth);
    RUN_TEST(growth_alone_gives_no_radius_beyond_64_states);
    RUN_TEST(what_grows_in_one_unit_only_does_not_count);
    return UNITY_END();
}
