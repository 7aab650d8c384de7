// SPDX-License-Identifier: MIT
// An output that is multiplied by another factor from some sample on, of five on a beam of four modes under noise; what changes all
// of them together, or the forces, is no matter of one output.
#include "record/changed_output.hpp"

#include <cmath>
#include <complex>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t count = 12000, outputs = 5, modes = 4;

/// What is done to a record of noise.
struct fault {
    double factor = 1;         ///< of output 2 after 60 %
    double machine = 0;        ///< amplitude of a sine in a shape of its own, after half of the record
    bool other_forces = false; ///< the second half has mode 1 weaker and mode 3 stronger
    std::size_t missing = 0;   ///< every so many samples one of output 1
};

record_set beam(unsigned seed, const fault& done) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    record_set set;
    set.n_y = outputs;
    std::vector<std::complex<double>> state(modes), pole;
    for (std::size_t k = 0; k < modes; ++k) {
        const double f = 0.03 * static_cast<double>((k + 1) * (k + 1)) / 1.6;
        pole.push_back(std::exp(2 * M_PI * f * std::complex<double>(-0.01, 1)));
    }
    std::vector<double> rows;
    for (std::size_t i = 0; i < count; ++i) {
        const bool late = 2 * i > count;
        for (std::size_t k = 0; k < modes; ++k) {
            const double force = done.other_forces && late ? (k == 0 ? 0.3 : k == 2 ? 3.0 : 1.0) : 1.0;
            state[k] = pole[k] * state[k] + force * normal(random);
        }
        for (std::size_t c = 0; c < outputs; ++c) {
            const double x = (static_cast<double>(c) + 0.7) / outputs;
            double y = 0.3 * normal(random);
            for (std::size_t k = 0; k < modes; ++k)
                y += std::sin(M_PI * static_cast<double>(k + 1) * x) * state[k].imag();
            if (late) y += done.machine * (1 + x) * std::sin(0.9 * static_cast<double>(i));
            if (c == 2 && 5 * i > 3 * count) y *= done.factor;
            if (c == 1 && done.missing > 0 && i % done.missing == 0) y = NAN;
            rows.push_back(y + 20 + 0.01 * static_cast<double>(i));
        }
    }
    set.add("beam", rows.data(), count);
    return set;
}

void named(const record_set& set, double factor) {
    const auto change = changed_output(set);
    TEST_ASSERT_TRUE(change.has_value());
    TEST_ASSERT_EQUAL_UINT64(2, change->output);
    TEST_ASSERT_DOUBLE_WITHIN(0.07, 0.6, change->at);
    TEST_ASSERT_DOUBLE_WITHIN(0.2 * std::abs(factor), factor, change->factor);
}

} // namespace

void setUp() {}
void tearDown() {}

static void a_gain_and_a_sign_are_named() {
    for (const unsigned seed : {1U, 2U, 3U})
        for (const double factor : {-1.0, 2.0, 0.5}) named(beam(seed, {factor}), factor);
}

static void missing_samples_change_nothing() { named(beam(4, {-1.0, 0, false, 50}), -1.0); }

static void what_changes_all_of_them_is_no_matter_of_one() {
    for (const unsigned seed : {1U, 2U, 3U, 4U}) {
        TEST_ASSERT_FALSE(changed_output(beam(seed, {})).has_value());
        TEST_ASSERT_FALSE(changed_output(beam(seed, {1.0, 0, true})).has_value());
        for (const double machine : {1.0, 5.0, 50.0})
            TEST_ASSERT_FALSE(changed_output(beam(seed, {1.0, machine})).has_value());
    }
}

/// Nothing moves for a quarter of the record, as where a logger fills a gap with the last value.
static void of_silence_nothing_is_known() {
    record_set set = beam(6, {-1.0});
    for (std::size_t i = 3000 * outputs; i < 6000 * outputs; ++i) set.samples[i] = 0;
    TEST_ASSERT_FALSE(changed_output(set).has_value());
}

static void two_outputs_a_force_or_a_short_record_say_nothing() {
    record_set set = beam(5, {-1.0});
    set.records.front().count = 3900;
    set.samples.resize(3900 * outputs);
    TEST_ASSERT_FALSE(changed_output(set).has_value());
    record_set forced = beam(5, {-1.0});
    forced.n_u = 1;
    forced.n_y = outputs - 1;
    TEST_ASSERT_FALSE(changed_output(forced).has_value());
    record_set two;
    two.n_y = 2;
    const record_set five = beam(5, {-1.0});
    std::vector<double> rows;
    for (std::size_t i = 0; i < count; ++i)
        rows.insert(rows.end(), {five.samples[i * outputs + 1], five.samples[i * outputs + 2]});
    two.add("two", rows.data(), count);
    TEST_ASSERT_FALSE(changed_output(two).has_value());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_gain_and_a_sign_are_named);
    RUN_TEST(missing_samples_change_nothing);
    RUN_TEST(what_changes_all_of_them_is_no_matter_of_one);
    RUN_TEST(of_silence_nothing_is_known);
    RUN_TEST(two_outputs_a_force_or_a_short_record_say_nothing);
    return UNITY_END();
}
