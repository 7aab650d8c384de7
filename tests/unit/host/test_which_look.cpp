// SPDX-License-Identifier: MIT
// Which of two looks is believed: modes and deviations put in by hand, each bound from both sides.
#include "narrow_bands.hpp"
#include "record/looks.hpp"
#include "result/judgement.hpp"

#include <unity.h>

using namespace okid_host;

namespace {

constexpr double damping = 0.01;

/// Modes of these frequencies; deviations of `share` of frequency and damping.
one_look look(const std::vector<double>& frequencies_hz, double share) {
    one_look out;
    out.work.context.sigma.emplace();
    for (const double f : frequencies_hz) {
        out.listed.push_back(mode_at(f, damping, {1.0}));
        out.work.context.sigma->frequency_hz.push_back(share * f);
        out.work.context.sigma->damping_ratio.push_back(share * damping);
    }
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void deviations_of_common_modes_are_compared() {
    std::vector<std::string> alone;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.25, deviations_over(look({10, 20}, 0.01), look({10.05, 20}, 0.04), alone));
    TEST_ASSERT_TRUE(alone.empty());
    one_look unequal = look({10, 20}, 0.01); // the second is known no better than before: the geometric mean
    unequal.work.context.sigma->frequency_hz[1] = 0.16 * 20;
    unequal.work.context.sigma->damping_ratio[1] = 0.16 * damping;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.25, deviations_over(unequal, look({10, 20}, 0.16), alone));
}

static void half_of_the_modes_must_be_there() {
    std::vector<std::string> alone;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.1, deviations_over(look({10, 20}, 0.01), look({10, 20, 30, 40.5}, 0.1), alone));
    TEST_ASSERT_EQUAL_UINT64(2, alone.size());
    TEST_ASSERT_EQUAL_STRING("40.5 Hz", alone[1].c_str());
    TEST_ASSERT_EQUAL_DOUBLE(1, deviations_over(look({10, 20}, 0.01), look({10, 20, 30, 40, 50}, 0.1), alone));
    TEST_ASSERT_EQUAL_DOUBLE(
        1, deviations_over(look({10.25}, 0.01), look({10}, 0.1), alone)); // half a bandwidth is 0.1 Hz
    TEST_ASSERT_EQUAL_DOUBLE(1, deviations_over(look({}, 0.01), look({10}, 0.1), alone));
    one_look unknown = look({10}, 0.01);
    unknown.work.context.sigma.reset();
    TEST_ASSERT_EQUAL_DOUBLE(1, deviations_over(unknown, look({10}, 0.1), alone));
}

static void damping_that_is_not_known_to_a_half_is_not_believed() {
    TEST_ASSERT_EQUAL_UINT64(2, look({10, 20}, 0.49).believed());
    TEST_ASSERT_EQUAL_UINT64(0, look({10, 20}, 0.51).believed());
    one_look doubtful = look({10, 20}, 0.1);
    doubtful.listed[0].in_model = false;
    TEST_ASSERT_EQUAL_UINT64(1, doubtful.believed());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(deviations_of_common_modes_are_compared);
    RUN_TEST(half_of_the_modes_must_be_there);
    RUN_TEST(damping_that_is_not_known_to_a_half_is_not_believed);
    return UNITY_END();
}
