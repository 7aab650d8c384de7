// SPDX-License-Identifier: MIT
// Shapes of a beam whose sensors come late, of a structure whose points do not move in phase, and such that say too little.
#include "record/late_outputs.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double scatter = 0.01;

/// Shapes over the places of a beam at 5 Hz, 20 Hz, 45 Hz .., each turned by an angle of its own.
std::vector<seen_shape> beam(int modes, const std::vector<double>& late, double complexity = 0) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    std::vector<seen_shape> out;
    for (int k = 1; k <= modes; ++k) {
        seen_shape one{5.0 * k * k, {}, {}};
        const double turned = normal(random);
        for (std::size_t i = 0; i < late.size(); ++i) {
            const double place =
                std::sin(M_PI * k * (0.13 + static_cast<double>(i)) / static_cast<double>(late.size()));
            const double angle = turned - 2 * M_PI * one.frequency_hz * late[i] + complexity * normal(random);
            const std::complex<double> noise(normal(random), normal(random));
            one.shape.push_back(place * std::polar(1.0, angle) + scatter * noise);
            one.variance.push_back(2 * scatter * scatter);
        }
        out.push_back(one);
    }
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void late_outputs_are_named_with_their_delays() {
    const std::vector<late_output> late = late_outputs(beam(5, {0, 1e-3, 0, 0, 1.5e-3, 0}));
    TEST_ASSERT_EQUAL_UINT64(2, late.size());
    TEST_ASSERT_EQUAL_UINT64(1, late[0].output);
    TEST_ASSERT_EQUAL_UINT64(4, late[1].output);
    TEST_ASSERT_DOUBLE_WITHIN(4 * late[0].std, 1e-3, late[0].seconds);
    TEST_ASSERT_DOUBLE_WITHIN(4 * late[1].std, 1.5e-3, late[1].seconds);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1.5e-3, late[1].seconds);
}

/// Of equal numbers, and where most are late: what counts is the earliest.
static void half_of_them_may_be_late() {
    TEST_ASSERT_EQUAL_UINT64(3, late_outputs(beam(5, {1e-3, 1e-3, 1e-3, 0, 0, 0})).size());
    TEST_ASSERT_EQUAL_UINT64(5, late_outputs(beam(5, {1e-3, 1e-3, 1e-3, 0, 1e-3, 1e-3})).size());
    TEST_ASSERT_EQUAL_UINT64(1, late_outputs(beam(5, {0, 0, 0, 1e-3, 0, 0})).size());
}

static void shapes_in_phase_have_none() { TEST_ASSERT_TRUE(late_outputs(beam(5, {0, 0, 0, 0, 0, 0})).empty()); }

static void what_delays_do_not_explain_is_none() {
    TEST_ASSERT_TRUE(late_outputs(beam(5, {0, 0, 0, 0, 0, 0}, 0.3)).empty());
    TEST_ASSERT_TRUE(late_outputs(beam(5, {0, 0}, 0.3)).empty());
    TEST_ASSERT_TRUE(late_outputs(beam(3, {0, 0}, 0.3)).empty());
}

static void two_modes_or_one_output_say_nothing() {
    TEST_ASSERT_TRUE(late_outputs(beam(2, {0, 1e-3, 0, 0, 1e-3, 0})).empty());
    TEST_ASSERT_TRUE(late_outputs(beam(5, {1e-3})).empty());
    TEST_ASSERT_TRUE(late_outputs({}).empty());
}

/// An output that a set-up does not have is not a number there.
static void entries_that_are_not_known_say_nothing() {
    std::vector<seen_shape> modes = beam(5, {0, 1e-3, 0, 0, 0, 0});
    for (seen_shape& mode : modes) {
        mode.shape[3] = {NAN, NAN};
        mode.variance[5] = NAN;
    }
    const std::vector<late_output> late = late_outputs(modes);
    TEST_ASSERT_EQUAL_UINT64(1, late.size());
    TEST_ASSERT_EQUAL_UINT64(1, late[0].output);
    for (seen_shape& mode : modes) mode.variance.assign(6, NAN);
    TEST_ASSERT_TRUE(late_outputs(modes).empty());
}

static void the_text_ends_after_six() {
    std::vector<late_output> late;
    for (std::size_t i = 0; i < 8; ++i) late.push_back({i, 1e-3 * static_cast<double>(i + 1), 1e-5});
    const std::vector<std::string> names{"a", "b", "c", "d", "e", "f", "g", "h"};
    TEST_ASSERT_EQUAL_STRING("a 1 ms, b 2 ms, c 3 ms, d 4 ms, e 5 ms, f 6 ms and 2 more",
                             late_text(late, names).c_str());
    late.resize(1);
    TEST_ASSERT_EQUAL_STRING("a 1 ms", late_text(late, names).c_str());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(late_outputs_are_named_with_their_delays);
    RUN_TEST(half_of_them_may_be_late);
    RUN_TEST(shapes_in_phase_have_none);
    RUN_TEST(what_delays_do_not_explain_is_none);
    RUN_TEST(two_modes_or_one_output_say_nothing);
    RUN_TEST(entries_that_are_not_known_say_nothing);
    RUN_TEST(the_text_ends_after_six);
    return UNITY_END();
}
