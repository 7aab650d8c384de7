// SPDX-License-Identifier: MIT
// A force that is recorded late: outputs made sample by sample from hits, and the force's channel moved by whole samples.
#include "narrow_bands.hpp"
#include "record/late_force.hpp"

#include <cmath>
#include <complex>
#include <cstring>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp() {}
void tearDown() {}

namespace {

constexpr std::size_t count = 6000;

/// Half sines of five samples.
series hammer(unsigned seed) {
    series force(count);
    for (const auto& [first, size] : hits_in(count, seed))
        for (std::size_t i = 0; i < 5 && first + i < count; ++i)
            force[first + i] += size * std::sin(M_PI * (static_cast<double>(i) + 0.5) / 5);
    return force;
}

/// Two modes under that force, and the force itself: an accelerometer. @param early  samples by which the sensor shows it before it is there
series answer_to(const series& force, unsigned seed, double noise, std::size_t early = 0) {
    series out = white(count, noise, seed);
    for (const auto& [hz, zeta] : {std::pair{17.3, 0.01}, std::pair{41.7, 0.02}}) {
        const std::complex<double> pole =
            std::polar(std::exp(-2 * M_PI * zeta * hz / sample_rate), 2 * M_PI * hz / sample_rate);
        std::complex<double> state = 0;
        for (std::size_t t = early; t < count; ++t) {
            out[t - early] += state.real() + force[t];
            state = pole * (state + std::complex<double>(-0.3, 0.2) * force[t]);
        }
    }
    return out;
}

series later(const series& x, std::size_t samples) {
    series out(x.size());
    std::copy(x.begin(), x.end() - static_cast<std::ptrdiff_t>(samples),
              out.begin() + static_cast<std::ptrdiff_t>(samples));
    return out;
}

std::size_t found(std::size_t late, double noise = 1e-3) {
    const series force = hammer(3);
    return samples_late(record_of({later(force, late), answer_to(force, 4, noise), answer_to(force, 5, noise)}, 1));
}

void a_late_force_is_late_by_so_many_samples() {
    for (const std::size_t late : {3U, 4U, 17U, 63U, 64U}) TEST_ASSERT_EQUAL_UINT64(late, found(late));
}

/// Two samples may be the precursor of a filter; beyond 64 nothing is looked for.
void others_are_not() {
    for (const std::size_t late : {0U, 1U, 2U, 70U}) TEST_ASSERT_EQUAL_UINT64(0, found(late));
    TEST_ASSERT_EQUAL_UINT64(0, found(17, 10)); // nothing tells
}

/// As many samples as a multiple of what is taken at a time.
void any_number_of_samples_will_do() {
    const series all = hammer(3), outputs = answer_to(all, 4, 1e-3);
    for (std::size_t samples = 1000; samples < 1300; ++samples) {
        const auto end = static_cast<std::ptrdiff_t>(samples);
        const series late = later(all, 12);
        TEST_ASSERT_EQUAL_UINT64(
            12, samples_late(record_of(
                    {series(late.begin(), late.begin() + end), series(outputs.begin(), outputs.begin() + end)}, 1)));
    }
}

/// One of three outputs that is early is a matter of its own.
void half_of_the_outputs_say_so() {
    const series force = hammer(3);
    const auto with = [&](std::vector<std::size_t> early) {
        std::vector<series> columns = {force};
        for (const std::size_t samples : early)
            columns.push_back(answer_to(force, static_cast<unsigned>(columns.size()), 1e-3, samples));
        return samples_late(record_of(columns, 1));
    };
    TEST_ASSERT_EQUAL_UINT64(9, with({9}));
    TEST_ASSERT_EQUAL_UINT64(7, with({0, 7}));
    TEST_ASSERT_EQUAL_UINT64(0, with({0, 7, 0}));
    TEST_ASSERT_EQUAL_UINT64(7, with({7, 0, 7}));
    TEST_ASSERT_EQUAL_UINT64(0, with({}));
}

/// A shaker that the structure moves knows what comes; a burst of noise is no hit.
void forces_that_are_no_hits_are_not_judged() {
    series burst = white(count, 1, 6);
    for (std::size_t t = 0; t < count; ++t) burst[t] *= t % 1500 < 60;
    TEST_ASSERT_EQUAL_UINT64(0, samples_late(record_of({later(burst, 9), answer_to(burst, 4, 1e-3)}, 1)));
    const series force = hammer(3);
    const series outputs = answer_to(force, 4, 1e-3);
    TEST_ASSERT_EQUAL_UINT64(0, samples_late(record_of({later(force, 9), later(force, 9), outputs}, 2)));
    TEST_ASSERT_EQUAL_UINT64(0, samples_late(record_of({series(count), outputs}, 1)));
    TEST_ASSERT_EQUAL_UINT64(0, samples_late(record_of({outputs}, 0)));
    TEST_ASSERT_EQUAL_UINT64(0, samples_late(record_of({series(80), series(80)}, 1)));
}

/// Missing samples are no evidence, and outputs stay where they are.
void the_force_is_taken_forward() {
    const series force = hammer(3);
    series outputs = answer_to(force, 4, 1e-3);
    outputs[700] = NAN;
    record_set set = record_of({later(force, 12), outputs}, 1);
    remarks said;
    bring_force_forward(set, sample_rate, said);
    TEST_ASSERT_EQUAL_UINT64(1, said.size());
    TEST_ASSERT_EQUAL_STRING("late_force", said[0].first.c_str());
    TEST_ASSERT_NOT_NULL(std::strstr(said[0].second.c_str(), "12 samples (46.9 ms) late"));
    for (std::size_t t = 0; t < count; ++t) {
        TEST_ASSERT_TRUE(set.samples[2 * t] == (t + 12 < count ? force[t] : set.samples[2 * count - 2]));
        TEST_ASSERT_TRUE(set.samples[2 * t + 1] == outputs[t] || t == 700);
    }
    bring_force_forward(set, sample_rate, said);
    TEST_ASSERT_EQUAL_UINT64(1, said.size());
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_late_force_is_late_by_so_many_samples);
    RUN_TEST(others_are_not);
    RUN_TEST(any_number_of_samples_will_do);
    RUN_TEST(half_of_the_outputs_say_so);
    RUN_TEST(forces_that_are_no_hits_are_not_judged);
    RUN_TEST(the_force_is_taken_forward);
    return UNITY_END();
}
