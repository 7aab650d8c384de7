// SPDX-License-Identifier: MIT
// Blocks of unequal power, drawn as what they say by themselves: ambient ones know a mode as well whatever their power, those of
// a decay as their energy. The deviation of the whole must be that of the draws.
#include "record/uneven_blocks.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr int draws = 400;
using numbers = std::vector<double>;

/// Mean over draws of the variance of a quantity: by energies alone, and with the widening; true: of the draws themselves.
struct variances {
    double truth = 0, by_energy = 0, widened = 0;
    int wider = 0; ///< draws
};

/// @param power  of each block; @param own  variance of what each says by itself
variances of(numbers power, const numbers& own) {
    double sum = 0;
    for (const double p : power) sum += p;
    for (double& p : power) p /= sum;
    std::mt19937 generator(11);
    std::normal_distribution<double> normal;
    variances out;
    for (int draw = 0; draw < draws; ++draw) {
        numbers f, zeta;
        double whole_f = 0, whole_zeta = 0, square = 0, unit = 0;
        for (std::size_t j = 0; j < power.size(); ++j) {
            f.push_back(std::sqrt(own[j]) * normal(generator));
            zeta.push_back(std::sqrt(own[j]) * normal(generator));
            whole_f += power[j] * f[j];
            whole_zeta += power[j] * zeta[j];
        }
        std::vector<mode_shift> shifts;
        for (std::size_t j = 0; j < power.size(); ++j) { // the whole without the block, less the whole
            mode_shift& one = shifts.emplace_back();
            one.frequency_hz = power[j] / (1 - power[j]) * (whole_f - f[j]);
            one.damping_ratio = power[j] / (1 - power[j]) * (whole_zeta - zeta[j]);
            square += std::pow((1 - power[j]) * one.frequency_hz, 2);
            unit += power[j] * (1 - power[j]);
        }
        const widening found = widening_of(shifts, power);
        TEST_ASSERT_TRUE(found.frequency >= 1 && found.damping >= 1);
        out.truth += whole_f * whole_f / draws;
        out.by_energy += square / unit / draws;
        out.widened += square / unit * found.frequency * found.frequency / draws;
        out.wider += found.frequency > 1.05;
    }
    return out;
}

void one_storm(void) {
    numbers power(20, 1.0);
    power[7] = 300;
    const variances storm = of(power, numbers(20, 1.0));
    TEST_ASSERT_TRUE(storm.by_energy < 0.1 * storm.truth); // deviations a third of what they should be, at most
    TEST_ASSERT_DOUBLE_WITHIN(0.25 * storm.truth, storm.truth, storm.widened);
}

void a_windy_night(void) {
    numbers power(20, 1.0);
    for (std::size_t j = 0; j < 5; ++j) power[j] = 100;
    const variances night = of(power, numbers(20, 1.0));
    TEST_ASSERT_TRUE(night.widened > 0.9 * night.truth && night.widened < 1.6 * night.truth);
}

void blocks_alike(void) {
    const variances all = of(numbers(20, 1.0), numbers(20, 1.0));
    TEST_ASSERT_DOUBLE_WITHIN(0.15 * all.truth, all.truth, all.widened);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * all.by_energy, all.by_energy, all.widened);
}

/// What a free decay tells goes with its energy: nothing is wider.
void a_decay(void) {
    for (const double rate : {0.4, 0.7, 1.5}) {
        numbers power, own;
        for (int j = 0; j < 20; ++j) {
            power.push_back(std::exp(-rate * j));
            own.push_back((1 - std::exp(-20 * rate)) / (1 - std::exp(-rate)) / power.back());
        }
        TEST_ASSERT_LESS_OR_EQUAL_INT(draws / 50, of(power, own).wider);
    }
}

void what_is_not_known_widens_nothing(void) {
    TEST_ASSERT_EQUAL_DOUBLE(1, widening_of({}, {}).frequency);
    TEST_ASSERT_EQUAL_DOUBLE(1, widening_of({mode_shift(), mode_shift()}, {0.5}).damping);
    TEST_ASSERT_EQUAL_DOUBLE(1, widening_of({mode_shift(), mode_shift()}, {0.5, 0.5}).damping); // nothing moved
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(one_storm);
    RUN_TEST(a_windy_night);
    RUN_TEST(blocks_alike);
    RUN_TEST(a_decay);
    RUN_TEST(what_is_not_known_widens_nothing);
    return UNITY_END();
}
