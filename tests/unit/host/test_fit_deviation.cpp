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

constexpr std::size_t count = 16384;

/// Two modes under a steady force, the first with a deviation that is `known`; the force is missing at `lost`, and noise is on both
/// outputs.
deviations found(std::size_t lost, double known = NAN,
                 std::vector<series> outputs = {white(count, 1e-4, 8), white(count, 1e-4, 9)}) {
    const std::vector<listed_mode> modes = {{8, 0.01, 1, 1, {1, 0.5}, true}, {11, 0.01, 1, 1, {-0.5, 1}, true}};
    series force = white(count, 1, 7);
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

/// Noise that shakes the structure is as strong at the mode as white noise of that density, and hardly there beside it; the exact
/// bound of its deviation is sqrt(0.75) of the other. The first mode alone is shaken.
void noise_that_shakes_the_structure_is_taken_at_the_mode() {
    double shaken = 0, still = 0;
    const double keeps = std::exp(-2 * M_PI * 8 * 0.01 / sample_rate), density = (1 + keeps) / (1 - keeps) / 4;
    for (unsigned seed = 0; seed < 8; ++seed) {
        std::vector<series> driven, even;
        for (unsigned o = 0; o < 2; ++o) {
            driven.push_back(white(count, 1e-6, 100 + 2 * seed + o));
            add(driven.back(), 1e-4, turning_at(8, chance_amplitude(count, 8, 0.01, 200 + 2 * seed + o)));
            even.push_back(white(count, 1e-4 * std::sqrt(density), 300 + 2 * seed + o));
        }
        shaken += std::pow(found(16000, NAN, driven).frequency_hz[0], 2);
        still += std::pow(found(16000, NAN, even).frequency_hz[0], 2);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 0.87, std::sqrt(shaken / still));
}

/// One output under a force: no shape tells such a mode from noise. Of two outputs, and without a force, other rules hold.
void a_wide_mode_of_one_output_is_doubtful() {
    for (const std::size_t n_u : {0U, 1U})
        for (const std::size_t n_y : {1U, 2U}) {
            std::vector<listed_mode> modes(4, {10, 0.01, 1, 1, std::vector<std::complex<double>>(n_y, 1), true});
            modes[3].in_model = false;
            record_work work;
            work.set.n_u = n_u;
            work.set.n_y = n_y;
            work.context.sigma = deviations();
            work.context.sigma->frequency_hz = {0.49, 0.51, 0.49, 0.51};
            work.context.sigma->damping_ratio = {0.0099, 0.0099, 0.0101, 0.0101};
            work.context.verdicts.assign(4, {true, 1, {}, false});
            const bool judged = n_u == 1 && n_y == 1;
            TEST_ASSERT_EQUAL(judged, doubt_wide(modes, work));
            for (std::size_t k = 0; k < 4; ++k) {
                const bool wide = judged && (k == 1 || k == 2);
                TEST_ASSERT_EQUAL(wide, has_code(work.context.verdicts[k].why, "wide_sigma"));
                TEST_ASSERT_EQUAL(!wide, work.context.verdicts[k].confident);
                TEST_ASSERT_EQUAL(!wide && k < 3, modes[k].in_model);
            }
        }
    std::vector<listed_mode> modes(1, {10, 0.01, 1, 1, {1.0}, true});
    record_work without;
    without.set.n_u = without.set.n_y = 1;
    TEST_ASSERT_FALSE(doubt_wide(modes, without));
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(what_a_few_samples_leave_open_is_no_deviation);
    RUN_TEST(a_deviation_that_is_known_stays);
    RUN_TEST(many_give_one);
    RUN_TEST(noise_that_shakes_the_structure_is_taken_at_the_mode);
    RUN_TEST(a_wide_mode_of_one_output_is_doubtful);
    return UNITY_END();
}
