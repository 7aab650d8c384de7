// SPDX-License-Identifier: MIT
// What a force rests at between hits: pulses and noise put into samples by hand, each bound from both sides.
#include "record/record_rest.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t samples = 4000;
constexpr double offset = 0.3, noise = 0.01;

using column = std::vector<double>;

column noisy(double sigma = noise) {
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    column out(samples);
    for (double& x : out) x = offset + sigma * normal(random);
    return out;
}

/// Half a sine of so many samples.
void strike(column& force, std::size_t first, double peak, std::size_t length = 8) {
    for (std::size_t i = 0; i < length; ++i)
        force[first + i] += peak * std::sin(M_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(length));
}

/// The force behind rest_between_hits(), beside an output that must stay; how many samples are left as they were.
std::size_t left_alone(const column& force, column* after = nullptr) {
    record_set set;
    set.n_u = set.n_y = 1;
    column rows;
    for (std::size_t i = 0; i < force.size(); ++i) rows.insert(rows.end(), {force[i], static_cast<double>(i)});
    set.add("made", rows.data(), force.size());
    rest_between_hits(set);
    std::size_t same = 0;
    for (std::size_t i = 0; i < force.size(); ++i) {
        TEST_ASSERT_TRUE(set.samples[2 * i + 1] == static_cast<double>(i));
        const bool missing = force[i] != force[i];
        TEST_ASSERT_EQUAL(missing, set.samples[2 * i] != set.samples[2 * i]);
        same += missing || set.samples[2 * i] == force[i];
        if (after) after->push_back(set.samples[2 * i]);
    }
    return same;
}

} // namespace

void setUp() {}
void tearDown() {}

/// The pulses stay with as many samples on either side as they have; all others are the same number, the offset of the channel.
static void noise_between_hits_goes() {
    for (const double sign : {1.0, -1.0}) {
        column force = noisy(), after;
        strike(force, 500, sign * 10);
        strike(force, 2000, sign * 7);
        strike(force, 2040, sign * 0.2); // the hammer touches once more
        force[3000] = NAN;
        TEST_ASSERT_LESS_THAN_UINT64(3 * 3 * 8 + 2, left_alone(force, &after));
        for (const std::size_t i : {500U, 507U, 2000U, 2004U, 2007U, 2042U, 2043U, 2044U})
            TEST_ASSERT_TRUE(after[i] == force[i]);
        for (const std::size_t i : {0U, 480U, 520U, 1980U, 2500U, 3999U})
            TEST_ASSERT_TRUE(after[i] == after[100] && std::abs(after[i] - offset) < noise / 10);
    }
}

/// A shaker's burst changes its sign, random and swept forces do not rest, and of a faint hit noise could be a part.
static void what_is_no_hit_is_left_alone() {
    TEST_ASSERT_EQUAL_UINT64(samples, left_alone(noisy(1)));
    column burst = noisy();
    for (std::size_t i = 1000; i < 1150; ++i) burst[i] += 10 * std::sin(0.7 * static_cast<double>(i));
    TEST_ASSERT_EQUAL_UINT64(samples, left_alone(burst));
    for (const double peak : {0.45, 0.55}) { // noise of 0.01 shows up to 0.05, a hit has ten times that
        column faint = noisy();
        strike(faint, 1000, peak);
        TEST_ASSERT_EQUAL(peak < 0.5, left_alone(faint) == samples);
    }
    for (const std::size_t hits : {20U, 30U}) { // of 8 samples: 4 and 6 % of all
        column often = noisy();
        for (std::size_t k = 0; k < hits; ++k) strike(often, 50 + 100 * k, 10);
        TEST_ASSERT_EQUAL(hits > 26, left_alone(often) == samples);
    }
}

/// Behind a channel without a reach to zero frequency the force comes back slowly, below its noise: that stays, the noise goes.
static void a_slow_way_back_stays() {
    column force = noisy(), after;
    strike(force, 500, 10);
    const auto back = [](std::size_t i) { return -0.03 * std::exp(-static_cast<double>(i - 508) / 150); };
    for (std::size_t i = 508; i < samples; ++i) force[i] += back(i);
    (void)left_alone(force, &after);
    for (std::size_t i = 580; i < 620; ++i) TEST_ASSERT_DOUBLE_WITHIN(0.006, offset + back(i), after[i]);
    for (const std::size_t i : {0U, 480U, 1500U, 3999U})
        TEST_ASSERT_TRUE(after[i] == after[100] && std::abs(after[i] - offset) < noise / 10);
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(noise_between_hits_goes);
    RUN_TEST(what_is_no_hit_is_left_alone);
    RUN_TEST(a_slow_way_back_stays);
    return UNITY_END();
}
