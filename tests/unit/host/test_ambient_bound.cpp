// SPDX-License-Identifier: MIT
// Standard deviations of modes without a measured force: under chance forces they are raised to what such forces leave unknown,
// of structures that are struck now and then they stay.
#include "narrow_bands.hpp"
#include "record/ambient_bound.hpp"

#include <algorithm>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t count = 40'000;
constexpr double zeta = 0.01;

const std::vector<listed_mode> modes = {mode_at(10, zeta), mode_at(11.5, zeta), mode_at(23, zeta)};

/// What becomes of deviations.
deviations bounded(const series& output, double before = 0, const std::vector<widening>& wider = {}) {
    deviations sigma;
    sigma.frequency_hz.assign(modes.size(), before);
    sigma.damping_ratio.assign(modes.size(), before);
    sigma.shape_re.assign(modes.size(), before);
    sigma.shape_im.assign(modes.size(), before);
    keep_to_ambient_bound(record_of({output}), sample_rate, modes, wider, sigma);
    return sigma;
}

series driven() {
    series out = white(count, 0.01, 9);
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const double f = modes[k].frequency_hz;
        add(out, 1, turning_at(f, chance_amplitude(count, f, zeta, static_cast<unsigned>(k + 1))));
    }
    return out;
}

/// Hits excite these modes; the others chance forces.
series hit(const std::vector<double>& of_hits) {
    series out = white(count, 0.01, 9);
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const double f = modes[k].frequency_hz;
        const bool struck_too = std::find(of_hits.begin(), of_hits.end(), f) != of_hits.end();
        add(out, 1,
            turning_at(f, struck_too ? struck(count, f, zeta, hits_in(count, 1))
                                     : chance_amplitude(count, f, zeta, static_cast<unsigned>(k + 1))));
    }
    return out;
}

void under_chance_forces_the_bound_holds(void) {
    const deviations sigma = bounded(driven());
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const double f = modes[k].frequency_hz, radians = 2 * M_PI * f * count / sample_rate;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * f, f * std::sqrt(zeta / (2 * radians)), sigma.frequency_hz[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, std::sqrt(zeta / radians), sigma.damping_ratio[k]);
    }
}

/// The first two beat with each other, 1.5 times a second: blocks of one length show no fall.
void what_rings_down_between_hits_has_no_bound(void) {
    const deviations sigma = bounded(hit({10, 11.5, 23}));
    for (std::size_t k = 0; k < modes.size(); ++k) {
        TEST_ASSERT_EQUAL_DOUBLE(0, sigma.frequency_hz[k]);
        TEST_ASSERT_EQUAL_DOUBLE(0, sigma.damping_ratio[k]);
    }
}

void beside_hits_a_mode_of_chance_forces_keeps_it(void) {
    const deviations sigma = bounded(hit({10, 11.5}));
    TEST_ASSERT_EQUAL_DOUBLE(0, sigma.damping_ratio[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0, sigma.damping_ratio[1]);
    TEST_ASSERT_TRUE(sigma.damping_ratio[2] > 0);
}

void missing_samples_are_left_out(void) {
    series output = hit({10, 11.5, 23});
    for (std::size_t t = 5'000; t < 5'300; ++t) output[t] = NAN;
    TEST_ASSERT_EQUAL_DOUBLE(0, bounded(output).damping_ratio[0]);
    output = driven();
    output[77] = NAN;
    TEST_ASSERT_TRUE(bounded(output).damping_ratio[0] > 0);
}

/// A storm: no bound, because its length is not that of the record, but what the blocks said of the modes.
void where_the_power_changes_deviations_are_widened(void) {
    series output = driven();
    for (std::size_t t = 12'000; t < 16'000; ++t) output[t] *= 30;
    const std::vector<widening> wider = {{2, 3}, {1, 1}, {4, 1}};
    const deviations sigma = bounded(output, 1e-9, wider);
    for (std::size_t k = 0; k < modes.size(); ++k) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1e-9 * wider[k].frequency, sigma.frequency_hz[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1e-9 * wider[k].damping, sigma.damping_ratio[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1e-9 * std::sqrt(wider[k].frequency * wider[k].damping), sigma.shape_re[k]);
    }
    TEST_ASSERT_EQUAL_DOUBLE(1e-9,
                             bounded(hit({10, 11.5, 23}), 1e-9, wider).frequency_hz[0]); // a hit tells by its energy
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(under_chance_forces_the_bound_holds);
    RUN_TEST(what_rings_down_between_hits_has_no_bound);
    RUN_TEST(beside_hits_a_mode_of_chance_forces_keeps_it);
    RUN_TEST(missing_samples_are_left_out);
    RUN_TEST(where_the_power_changes_deviations_are_widened);
    return UNITY_END();
}
