// SPDX-License-Identifier: MIT
// Modes told from the distortion that a structure makes: vibrations under chance forces, and products of them.
#include "narrow_bands.hpp"
#include "record/combinations.hpp"
#include "record/record_fit.hpp"

#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t usual = 60'000;

/// A vibration that is n-th power of one, or the conjugate's for n < 0, of the amplitudes alone.
analytic power_of(const analytic& of, int n) {
    analytic out = of;
    for (auto& x : out) x = std::pow(n > 0 ? x : std::conj(x), std::abs(n));
    return out;
}

analytic times(analytic a, const analytic& b) {
    for (std::size_t t = 0; t < a.size(); ++t) a[t] *= b[t];
    return a;
}

/// Amplitudes of 10 and 13 Hz, which all records here have.
analytic ten(std::size_t count = usual) { return chance_amplitude(count, 10, 0.003, 1); }
analytic thirteen(std::size_t count = usual) { return chance_amplitude(count, 13, 0.003, 2); }

struct judged {
    std::vector<listed_mode> modes;
    record_work work;
    bool taken_out = false;
    bool is(std::size_t k, const char* code) const {
        const auto& why = work.context.verdicts[k].why;
        return std::find(why.begin(), why.end(), code) != why.end();
    }
    std::string nonlinear() const { return warning(work, "nonlinear"); }
};

judged look(const std::vector<series>& outputs, const std::vector<listed_mode>& modes) {
    judged out;
    out.modes = modes;
    out.work.set = record_of(outputs);
    out.work.context.verdicts.assign(modes.size(), verdict());
    out.taken_out = mark_combinations(out.modes, sample_rate, out.work);
    return out;
}

/// Modes of 10 and 13 Hz, and a third vibration of so much amplitude, listed or not.
judged with_third(double hz, const analytic& amplitude, double size = 0.1, bool listed = true) {
    const std::size_t count = amplitude.size();
    series out = white(count, 0.01, 9);
    add(out, 1, turning_at(10, ten(count)));
    add(out, 0.8, turning_at(13, thirteen(count)));
    add(out, size, turning_at(hz, amplitude));
    std::vector<listed_mode> modes = {mode_at(10, 0.01), mode_at(13, 0.01)};
    if (listed) modes.push_back(mode_at(hz, 0.01));
    return look({out}, modes);
}

} // namespace

void setUp() {}
void tearDown() {}

/// Twice, three and five times one vibration, the sum of two, and what cubes make of two.
static void products_of_stronger_vibrations_are_no_modes() {
    const struct {
        double hz;
        analytic amplitude;
        const char* words;
    } cases[] = {{20, power_of(ten(), 2), "20 Hz = 2 × 10 moves"},
                 {30, power_of(ten(), 3), "30 Hz = 3 × 10 moves"},
                 {50, power_of(ten(), 5), "50 Hz = 5 × 10 moves"},
                 {23, times(ten(), thirteen()), "23 Hz = 10 + 13 moves"},
                 {33, times(power_of(ten(), 2), thirteen()), "33 Hz = 2 × 10 + 13 moves"},
                 {16, times(power_of(ten(), -1), power_of(thirteen(), 2)), "16 Hz = −10 + 2 × 13 moves"},
                 {7, times(power_of(ten(), 2), power_of(thirteen(), -1)), "7 Hz = 2 × 10 − 13 moves"}};
    for (const auto& one : cases) {
        const judged found = with_third(one.hz, one.amplitude);
        TEST_ASSERT_TRUE(found.taken_out && found.is(2, "harmonic"));
        TEST_ASSERT_FALSE(found.modes[2].in_model || found.work.context.verdicts[2].confident);
        TEST_ASSERT_TRUE(found.modes[0].in_model && found.modes[1].in_model);
        TEST_ASSERT_TRUE_MESSAGE(contains(found.nonlinear(), one.words), found.nonlinear().c_str());
    }
}

static void a_mode_at_a_product_stays_a_mode() {
    for (const double hz : {20.0, 30.0, 50.0, 23.0, 33.0, 16.0, 7.0}) {
        const judged found = with_third(hz, chance_amplitude(usual, hz, 0.01, 5));
        TEST_ASSERT_FALSE(found.taken_out);
        TEST_ASSERT_TRUE(found.work.context.verdicts[2].why.empty() && found.nonlinear().empty());
    }
}

/// Hits that nobody measured put all modes in phase, again and again: that makes no products of them.
static void modes_between_hits_are_no_products() {
    const auto hits = hits_in(usual, 3);
    for (const double hz : {20.02, 23.02, 30.02}) {
        series out = white(usual, 0.001, 9);
        add(out, 1, turning_at(10, struck(usual, 10, 0.004, hits)));
        add(out, 0.8, turning_at(13, struck(usual, 13, 0.004, hits)));
        add(out, 0.1, turning_at(hz, struck(usual, hz, 0.004, hits)));
        const judged found = look({out}, {mode_at(10, 0.004), mode_at(13, 0.004), mode_at(hz, 0.004)});
        TEST_ASSERT_TRUE(!found.taken_out && found.nonlinear().empty());
    }
}

/// As displacements, whatever the sensor: at twice the frequency four times the amplitude are as strong.
static void only_what_is_weaker_is_a_product() {
    TEST_ASSERT_TRUE(with_third(20, power_of(ten(), 2), 1).is(2, "harmonic"));
    TEST_ASSERT_FALSE(with_third(20, power_of(ten(), 2), 8).is(2, "harmonic"));
}

/// Within a hundredth and a half, or half a bandwidth; of a structure known not to be linear two and a half.
static void a_product_stands_at_the_sum_of_frequencies() {
    const auto second = [](double listed_hz, double damping_ratio) {
        series out = white(usual, 0.01, 9);
        add(out, 1, turning_at(10, ten()));
        add(out, 0.1, turning_at(20, power_of(ten(), 2)));
        return look({out}, {mode_at(10, 0.01), mode_at(listed_hz, damping_ratio)}).is(1, "harmonic");
    };
    TEST_ASSERT_TRUE(second(20.28, 0.001) && second(19.72, 0.001));
    TEST_ASSERT_FALSE(second(20.32, 0.001) || second(19.68, 0.001));
    TEST_ASSERT_TRUE(second(20.38, 0.02) && !second(20.42, 0.02));
}

/// In a structure that is not linear half of the phases are enough, and a neighbourhood twice as wide.
static void one_product_makes_others_likely() {
    const auto mixed = [](double in_phase) { // of the same power: so much of it the square of the first
        analytic out = power_of(ten(), 2), other = chance_amplitude(usual, 20, 0.01, 21);
        for (std::size_t t = 0; t < usual; ++t)
            out[t] = in_phase * out[t] + std::sqrt(2 - 2 * in_phase * in_phase) * other[t];
        return out;
    };
    for (const bool distorted : {false, true}) {
        series out = white(usual, 0.01, 9);
        add(out, 1, turning_at(10, ten()));
        add(out, 0.05, turning_at(20, mixed(0.6)));
        add(out, 0.02, turning_at(30, distorted ? power_of(ten(), 3) : chance_amplitude(usual, 30, 0.01, 6)));
        const judged found = look({out}, {mode_at(10, 0.01), mode_at(20, 0.01), mode_at(30, 0.01)});
        TEST_ASSERT_EQUAL(distorted, found.is(1, "harmonic"));
        TEST_ASSERT_EQUAL(distorted, found.is(2, "harmonic"));
    }
}

/// Where no mode is listed the remark says so, and nothing is taken out.
static void distortion_is_reported_without_a_mode() {
    const judged found = with_third(20, power_of(ten(), 2), 0.1, false);
    TEST_ASSERT_TRUE(!found.taken_out && contains(found.nonlinear(), "20 Hz = 2 × 10"));
    TEST_ASSERT_TRUE(with_third(20, chance_amplitude(usual, 20, 0.01, 5), 0.1, false).nonlinear().empty());
}

/// What a machine does is in phase by itself: beside a multiple of a line nothing is told. Wherever the line stands in the list.
static void multiples_of_a_line_are_no_distortion() {
    series out = white(usual, 0.01, 9);
    add(out, 1, turning_at(10, ten()));
    add(out, 0.8, turning_at(13, thirteen()));
    add(out, 0.1, turning_at(20, power_of(ten(), 2)));
    for (const double line_hz : {5.0, 6.0, 20.0})
        for (const std::size_t place : {0, 2}) {
            judged found;
            found.modes = {mode_at(10, 0.01), mode_at(13, 0.01)};
            found.modes.insert(found.modes.begin() + static_cast<std::ptrdiff_t>(place), mode_at(line_hz, 1e-4));
            found.work.set = record_of({out});
            found.work.context.verdicts.assign(3, verdict());
            found.work.context.verdicts[place] = verdict({"tone"});
            found.modes[place].in_model = false;
            found.taken_out = mark_combinations(found.modes, sample_rate, found.work);
            const bool multiple = line_hz == 5 || line_hz == 20;
            TEST_ASSERT_TRUE(!found.taken_out && multiple == found.nonlinear().empty());
            TEST_ASSERT_TRUE(multiple || contains(found.nonlinear(), "20 Hz = 2 × 10"));
        }
}

/// Sixteen blocks of six periods of 10 Hz, 154 samples each; of a vibration whose phase alone wanders.
static void few_blocks_show_no_coherence() {
    for (const std::size_t count : {16 * 154, 16 * 154 - 1}) {
        analytic steady(count);
        for (std::size_t t = 0; t < count; ++t)
            steady[t] = std::polar(1.0, 3 * std::sin(0.001 * static_cast<double>(t)));
        series out = white(count, 0.01, 9);
        add(out, 1, turning_at(10, steady));
        add(out, 0.1, turning_at(20, power_of(steady, 2)));
        TEST_ASSERT_EQUAL(count % 154 == 0, look({out}, {mode_at(10, 0.01), mode_at(20, 0.01)}).is(1, "harmonic"));
    }
}

/// The phases of a free decay are those of its hit: of linear structures too they go together.
static void a_single_decay_proves_nothing() {
    const std::size_t count = 16 * 154;
    analytic decay(count);
    for (std::size_t t = 0; t < count; ++t) decay[t] = std::exp(-0.003 * static_cast<double>(t));
    series out = white(count, 1e-5, 9);
    add(out, 1, turning_at(10, decay));
    add(out, 0.1, turning_at(20, power_of(decay, 2)));
    TEST_ASSERT_TRUE(look({out}, {mode_at(10, 0.01), mode_at(20, 0.01)}).nonlinear().empty());
}

/// Several outputs are looked at along the shape of the mode: what they share elsewhere does not disturb.
static void modes_are_looked_at_along_their_shape() {
    series sum = white(usual, 0.01, 9), difference = white(usual, 0.01, 10);
    add(sum, 1, turning_at(10, ten()));
    add(difference, 0.1, turning_at(20, power_of(ten(), 2)));
    series first(usual), second(usual);
    const series loud = white(usual, 1, 11);
    for (std::size_t t = 0; t < usual; ++t) {
        first[t] = sum[t] + difference[t] + loud[t];
        second[t] = sum[t] - difference[t] + loud[t];
    }
    TEST_ASSERT_TRUE(
        look({first, second}, {mode_at(10, 0.01, {1.0, 1.0}), mode_at(20, 0.01, {1.0, -1.0})}).is(1, "harmonic"));
    TEST_ASSERT_FALSE(
        look({first, second}, {mode_at(10, 0.01, {1.0, 1.0}), mode_at(20, 0.01, {1.0, 1.0})}).is(1, "harmonic"));
}

/// A force drives 10 Hz, and 20 Hz where there is such a mode; the sensor or the structure squares; something else shakes 35 Hz.
static void a_force_tells_modes_from_distortion() {
    for (const bool squares : {false, true})
        for (const bool has_mode : {false, true}) {
            const series force = white(usual, 1, 7);
            const std::vector<listed_mode> modes = {mode_at(10, 0.01), mode_at(20, 0.01), mode_at(35, 0.01)};
            series out = white(usual, 0.01, 8), linear(usual);
            std::complex<double> states[2];
            for (std::size_t t = 0; t < usual; ++t) {
                linear[t] = states[0].real() + (has_mode ? states[1].real() : 0);
                out[t] += linear[t] + (squares ? 0.15 * states[0].real() * states[0].real() : 0);
                for (std::size_t k = 0; k < 2; ++k)
                    states[k] = discrete_pole(modes[k], 1 / sample_rate) * states[k] +
                                std::complex<double>(0.1, 0.05) * force[t];
            }
            add(out, 0.1, turning_at(35, chance_amplitude(usual, 35, 0.01, 3)));
            judged found;
            found.modes = modes;
            found.work.set = record_of({force, out}, 1);
            remove_means(found.work.set);
            found.work.context.outputs = {"a"};
            found.work.context.verdicts.assign(3, verdict());
            make_modal_model(modes, sample_rate, found.work);
            TEST_ASSERT_FALSE(mark_combinations(found.modes, sample_rate, found.work)); // its states are not known
            fit_records(found.work.set, found.work.model, found.work.context);
            found.taken_out = mark_combinations(found.modes, sample_rate, found.work);
            const bool seen =
                squares && !has_mode; // a resonance that the force drives is a mode, whatever else is there
            TEST_ASSERT_EQUAL(seen, !found.nonlinear().empty());
            TEST_ASSERT_EQUAL(seen, found.is(1, "harmonic"));
            TEST_ASSERT_EQUAL(seen, found.is(2, "undriven"));
            TEST_ASSERT_TRUE(found.modes[0].in_model && found.taken_out == seen);
        }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(products_of_stronger_vibrations_are_no_modes);
    RUN_TEST(a_mode_at_a_product_stays_a_mode);
    RUN_TEST(modes_between_hits_are_no_products);
    RUN_TEST(only_what_is_weaker_is_a_product);
    RUN_TEST(a_product_stands_at_the_sum_of_frequencies);
    RUN_TEST(one_product_makes_others_likely);
    RUN_TEST(distortion_is_reported_without_a_mode);
    RUN_TEST(multiples_of_a_line_are_no_distortion);
    RUN_TEST(few_blocks_show_no_coherence);
    RUN_TEST(a_single_decay_proves_nothing);
    RUN_TEST(modes_are_looked_at_along_their_shape);
    RUN_TEST(a_force_tells_modes_from_distortion);
    return UNITY_END();
}
