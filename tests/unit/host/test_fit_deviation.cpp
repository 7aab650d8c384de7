// SPDX-License-Identifier: MIT
// Deviations of modes by a least-squares fit, where a jackknife gives none: a run through the model ends where a force is
// missing, and what so few samples leave open is no deviation.
#include "narrow_bands.hpp"
#include "record/fit_deviation.hpp"

#include <cmath>
#include <complex>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp() {}
void tearDown() {}

namespace {

/// Two modes under a steady force, the first with a deviation that is `known`; the force is missing at `lost`, and noise is on both
/// outputs.
deviations found(std::size_t lost, double known = NAN) {
    const std::size_t count = 16384;
    const std::vector<listed_mode> modes = {{8, 0.01, 1, 1, {1, 0.5}, true}, {11, 0.01, 1, 1, {-0.5, 1}, true}};
    series force = white(count, 1, 7);
    std::vector<series> outputs = {white(count, 1e-4, 8), white(count, 1e-4, 9)};
    for (const listed_mode& mode : modes) {
        std::complex<double> state = 0;
        for (std::size_t t = 0; t < count; ++t) {
            for (std::size_t o = 0; o < 2; ++o) outputs[o][t] += (mode.shape[o] * state).real();
            state = discrete_pole(mode, 1 / sample_rate) * state + std::complex<double>(0.2, 0.1) * force[t];
        }
    }
    force[lost] = NAN;
    record_work work;
    work.set = record_of({force, outputs[0], outputs[1]}, 1);
    make_modal_model(modes, sample_rate, work);
    deviations none;
    none.frequency_hz = none.damping_ratio = std::vector<double>{known, NAN};
    none.shape_re = none.shape_im = std::vector<double>(4, NAN);
    work.context.sigma = none;
    work.context.x0 = std::vector<std::vector<double>>{{0, 0, 0, 0}};
    work.apart = {{0, 0}, {0, 0}};
    deviations_by_fit(modes, work);
    return *work.context.sigma;
}

void what_a_few_samples_leave_open_is_no_deviation() {
    for (std::size_t lost = 4; lost < 40; ++lost) {
        const deviations by = found(lost);
        for (std::size_t k = 0; k < 2; ++k) {
            TEST_ASSERT_FALSE(by.frequency_hz[k] >= sample_rate / 2);
            TEST_ASSERT_FALSE(by.damping_ratio[k] >= 1);
            TEST_ASSERT_EQUAL(by.frequency_hz[k] > 0, by.damping_ratio[k] > 0); // both or neither
        }
    }
}

/// All that such a run hears of a mode is near the begin, but the mode is not of one event.
void a_deviation_that_is_known_stays() {
    const deviations by = found(60, 1e-4);
    TEST_ASSERT_EQUAL_DOUBLE(1e-4, by.frequency_hz[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1e-4, by.damping_ratio[0]);
}

void many_give_one() {
    const deviations by = found(16000);
    for (std::size_t k = 0; k < 2; ++k) {
        TEST_ASSERT_TRUE(by.frequency_hz[k] > 1e-8 && by.frequency_hz[k] < 1e-6);
        TEST_ASSERT_TRUE(by.damping_ratio[k] > 1e-9 && by.damping_ratio[k] < 1e-7);
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(what_a_few_samples_leave_open_is_no_deviation);
    RUN_TEST(a_deviation_that_is_known_stays);
    RUN_TEST(many_give_one);
    return UNITY_END();
}
