// SPDX-License-Identifier: MIT
// Short gaps are bridged by what the samples around them say, long ones stay.
#include "consensus/gap_bridge.hpp"
#include "consensus/levels.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double missing = NAN;

bool is_missing(double x) { return x != x; } // old versions of Unity have a macro isnan

/// A white force and the acceleration that it causes on one mass at 0.06 of the rate, with a little noise.
sample_rows shaken(std::size_t count, double noise = 0.01) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    sample_rows out;
    double one = 0, two = 0, before = 0, two_before = 0;
    for (std::size_t n = 0; n < count; ++n) {
        const double u = normal(random);
        const double y = 1.85 * one - 0.98 * two + u - 2 * before + two_before; // a mode seen by its acceleration
        two = one, one = y, two_before = before, before = u;
        out.push_back(u);
        out.push_back(y + noise * normal(random));
    }
    return out;
}

void lose(sample_rows& rows, std::size_t first, std::size_t count) {
    for (std::size_t i = 2 * first; i < 2 * (first + count); ++i) rows[i] = missing;
}

double size_of(const sample_rows& rows, std::size_t c) {
    double sum = 0;
    for (std::size_t i = c; i < rows.size(); i += 2) sum += rows[i] * rows[i];
    return std::sqrt(2 * sum / static_cast<double>(rows.size()));
}

void single_rows() {
    const sample_rows whole = shaken(20000);
    sample_rows lossy = whole;
    for (std::size_t n = 0; n < 20000; n += 200) lose(lossy, n, 1); // the first row too
    lose(lossy, 19999, 1);
    const auto out = bridge_gaps({lossy}, 2);
    TEST_ASSERT_EQUAL_UINT64(1, out.size());
    double force = 0, acceleration = 0;
    for (std::size_t n = 200; n < 19900; n += 200) {
        force += std::pow(out[0][2 * n] - whole[2 * n], 2);
        acceleration += std::pow(out[0][2 * n + 1] - whole[2 * n + 1], 2);
    }
    // a white force tells nothing of itself; what it did to the mass tells it
    TEST_ASSERT_TRUE(std::sqrt(force / 99) < 0.1 * size_of(whole, 0));
    TEST_ASSERT_TRUE(std::sqrt(acceleration / 99) < 0.1 * size_of(whole, 1));
    for (std::size_t i = 0; i < whole.size(); ++i) {
        TEST_ASSERT_TRUE(!is_missing(out[0][i]));
        if (!is_missing(lossy[i])) TEST_ASSERT_EQUAL_DOUBLE(lossy[i], out[0][i]);
    }
}

void one_channel_of_a_row() {
    const sample_rows whole = shaken(20000);
    sample_rows lossy = whole;
    for (std::size_t n = 100; n < 20000; n += 150) lossy[2 * n + 1] = missing;
    const auto out = bridge_gaps({lossy}, 2);
    double square = 0;
    for (std::size_t n = 100; n < 20000; n += 150) square += std::pow(out[0][2 * n + 1] - whole[2 * n + 1], 2);
    TEST_ASSERT_TRUE(std::sqrt(square / 133) < 0.03 * size_of(whole, 1));
}

void long_gaps_stay() {
    sample_rows rows = shaken(20000);
    lose(rows, 500, 10);
    lose(rows, 5000, 11);
    lose(rows, 9000, 3000);
    const auto out = bridge_gaps({rows}, 2);
    TEST_ASSERT_TRUE(!is_missing(out[0][2 * 500]) && !is_missing(out[0][2 * 509]));
    for (const std::size_t n : {5000, 5010, 9000, 11999}) TEST_ASSERT_TRUE(is_missing(out[0][2 * n]));
}

void nothing_to_bridge() {
    const sample_rows whole = shaken(3000);
    TEST_ASSERT_TRUE(bridge_gaps({whole, whole}, 2).empty());
    sample_rows lossy = whole;
    for (std::size_t n = 0; n < 3000; n += 8) lose(lossy, n, 1); // more than a tenth
    TEST_ASSERT_TRUE(bridge_gaps({lossy}, 2).empty());
    sample_rows brief = shaken(20);
    lose(brief, 10, 1);
    TEST_ASSERT_TRUE(bridge_gaps({brief}, 2).empty());
}

void a_channel_that_stands_still() {
    sample_rows rows = shaken(5000);
    for (std::size_t i = 1; i < rows.size(); i += 2) rows[i] = 0;
    lose(rows, 2000, 2);
    const auto out = bridge_gaps({rows}, 2);
    TEST_ASSERT_EQUAL_DOUBLE(0, out[0][2 * 2000 + 1]);
    TEST_ASSERT_TRUE(!is_missing(out[0][2 * 2001]));
}

/// A lost row is a gap at no rate.
void no_rate_has_a_gap() {
    std::vector<double> scale;
    sample_rows rows = shaken(20000);
    for (std::size_t n = 50; n < 20000; n += 100) lose(rows, n, 1);
    const auto levels = make_levels({rows}, 1, 1, 1000, false, 1, scale);
    TEST_ASSERT_EQUAL_INT64(20000, levels[0].samples);
    TEST_ASSERT_TRUE(!is_missing(levels[0].records[0][2 * 50]));
    TEST_ASSERT_EQUAL_UINT64(5, levels.size()); // 1000 to 62.5 Hz
    TEST_ASSERT_TRUE(levels[1].samples > 9900);
    const auto coarse = make_levels({rows}, 1, 1, 1000, false, 4, scale);
    TEST_ASSERT_TRUE(coarse[0].samples > 4900);
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(single_rows);
    RUN_TEST(one_channel_of_a_row);
    RUN_TEST(long_gaps_stay);
    RUN_TEST(nothing_to_bridge);
    RUN_TEST(a_channel_that_stands_still);
    RUN_TEST(no_rate_has_a_gap);
    return UNITY_END();
}
