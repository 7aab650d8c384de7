// SPDX-License-Identifier: MIT
// Which hits are accepted: a sensor that hardly moves shows its noise, a structure that moves is waited for.
#include "record/hit_verdict.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t before = 200, count = 2048, width = 3;
constexpr double rate_hz = 1024, pulse[] = {30, 100, 80, 20};

std::vector<hit_channel> channels(const char* unit_of_weak) {
    return {{"hammer", true, "N"}, {"strong", false, "m/s^2"}, {"weak", false, unit_of_weak}};
}

/// A force of four samples, a sensor that rings down and another that hardly moves.
/// @param motion  amplitude before the hit over that after it
std::vector<double> hit(double weak_amplitude, double motion) {
    std::mt19937 random(4);
    std::normal_distribution<double> noise(0, 0.02);
    std::vector<double> rows;
    for (std::size_t n = 0; n < count; ++n) {
        const double t = (static_cast<double>(n) - static_cast<double>(before)) / rate_hz;
        const double ring = t < 0 ? motion * std::sin(300 * t) : std::exp(-5 * t) * std::sin(300 * t);
        rows.push_back(n >= before && n < before + 4 ? pulse[n - before] : 0.1 * noise(random));
        rows.push_back(5 * ring + noise(random));
        rows.push_back(weak_amplitude * ring + noise(random));
    }
    return rows;
}

std::string fault_of(const std::vector<double>& rows, const std::vector<hit_channel>& of) {
    hit_window window;
    window.rows = rows.data();
    window.count = count;
    window.width = width;
    window.before = before;
    window.rate_hz = rate_hz;
    window.channels = &of;
    return judge_hit(window).fault;
}

void test_noise_of_a_sensor_that_hardly_moves_is_no_motion() {
    TEST_ASSERT_EQUAL_STRING("", fault_of(hit(0.02, 0), channels("m/s^2")).c_str());
}

void test_a_sensor_of_another_unit_is_judged_by_itself() {
    TEST_ASSERT_EQUAL_STRING("moving", fault_of(hit(0.02, 0), channels("m/s")).c_str());
}

void test_a_structure_that_rings_is_waited_for() {
    TEST_ASSERT_EQUAL_STRING("", fault_of(hit(5, 0.04), channels("m/s^2")).c_str());
    TEST_ASSERT_EQUAL_STRING("moving", fault_of(hit(5, 0.2), channels("m/s^2")).c_str());
    TEST_ASSERT_EQUAL_STRING("moving", fault_of(hit(0.02, 0.2), channels("m/s^2")).c_str());
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_noise_of_a_sensor_that_hardly_moves_is_no_motion);
    RUN_TEST(test_a_sensor_of_another_unit_is_judged_by_itself);
    RUN_TEST(test_a_structure_that_rings_is_waited_for);
    return UNITY_END();
}
