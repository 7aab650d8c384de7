// SPDX-License-Identifier: MIT
// Which hits are accepted: a sensor that hardly moves shows its noise, a structure that moves is waited for. Where a record of
// several is cut.
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

/// A noisy force with pulses of so many samples at these places.
std::vector<double> struck_at(const std::vector<std::size_t>& places, std::size_t length = 4) {
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0, 0.02);
    std::vector<double> out;
    for (std::size_t n = 0; n < count; ++n) out.push_back(3 + noise(random)); // 3: it is not balanced
    for (const std::size_t first : places)
        for (std::size_t n = 0; n < length; ++n) out[first + n] -= 80; // and reads negative
    return out;
}

std::vector<std::size_t> cuts_of(const std::vector<double>& force) { return find_cuts(force.data(), force.size(), 1); }

void test_a_record_is_cut_before_each_hit_but_the_first() {
    TEST_ASSERT_EQUAL(0, cuts_of(struck_at({100})).size());
    const std::vector<std::size_t> found = cuts_of(struck_at({100, 900, 1540}));
    TEST_ASSERT_EQUAL(2, found.size());
    TEST_ASSERT_EQUAL(900 - 800 / 8, found[0]); // an eighth of the time since the hit before stays before it
    TEST_ASSERT_EQUAL(1540 - 640 / 8, found[1]);
}

void test_a_second_pulse_soon_after_the_first_is_the_same_hit() {
    const std::size_t first = 100,
                      rest = count - first; // the longest time between two is d, or what follows the second
    const auto two = [&](std::size_t d) { return cuts_of(struck_at({first, first + d})).size(); };
    TEST_ASSERT_EQUAL(0, two(rest / 5 - 8));
    TEST_ASSERT_EQUAL(1, two(rest / 5 + 8));
}

void test_a_force_that_pushes_is_no_hit() {
    TEST_ASSERT_EQUAL(1, cuts_of(struck_at({100, 1100}, 80)).size());
    TEST_ASSERT_EQUAL(0, cuts_of(struck_at({100, 1100}, 120)).size()); // more than a tenth of the time to the next
    std::vector<double> shaker = struck_at({});
    std::mt19937 random(6);
    std::normal_distribution<double> force(0, 50);
    for (double& x : shaker) x += force(random);
    TEST_ASSERT_EQUAL(0, cuts_of(shaker).size());
    TEST_ASSERT_EQUAL(0, cuts_of(std::vector<double>(100, NAN)).size());
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_noise_of_a_sensor_that_hardly_moves_is_no_motion);
    RUN_TEST(test_a_sensor_of_another_unit_is_judged_by_itself);
    RUN_TEST(test_a_structure_that_rings_is_waited_for);
    RUN_TEST(test_a_record_is_cut_before_each_hit_but_the_first);
    RUN_TEST(test_a_second_pulse_soon_after_the_first_is_the_same_hit);
    RUN_TEST(test_a_force_that_pushes_is_no_hit);
    return UNITY_END();
}
