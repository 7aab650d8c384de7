// SPDX-License-Identifier: MIT
// Modes that move with the level of vibration or with time, and those that do not: vibrations under chance forces, and under a
// force that is measured.
#include "narrow_bands.hpp"
#include "record/record_fit.hpp"
#include "record/steadiness.hpp"

#include <functional>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t usual = 60'000, long_enough = 480'000;
constexpr double width = 0.02; ///< half-power bandwidth of damping 0.01, relative

using law = std::function<double(double level, double time)>; ///< of a relative change of frequency

double steady(double, double) { return 0; }
law with_level(double change) {
    return [=](double level, double) { return change * (level - 1); };
}
law with_time(double change) {
    return [=](double, double time) { return change * time; };
}

struct judged {
    record_work work;
    bool level() const { return !warning(work, "level_dependent").empty(); }
    bool drift() const { return !warning(work, "time_varying").empty(); }
};

/// A vibration of 10 Hz under chance forces, whose frequency follows a law of time (-1 / 2 .. 1 / 2).
series moving(std::size_t count, const law& change, double damping_ratio = 0.01) {
    const analytic amplitude = chance_amplitude(count, 10, damping_ratio, 1);
    series out = white(count, 0.05, 11);
    double phase = 0;
    for (std::size_t t = 0; t < count; ++t) {
        phase +=
            2 * M_PI * 10 / sample_rate * (1 + change(1, static_cast<double>(t) / static_cast<double>(count) - 0.5));
        out[t] += (amplitude[t] * std::polar(1.0, phase)).real();
    }
    return out;
}

judged look(const series& output, const std::vector<listed_mode>& modes) {
    judged out;
    out.work.set = record_of({output});
    remark_unsteady(modes, sample_rate, out.work);
    return out;
}

judged of_noise(const law& change, double damping_ratio = 0.01, std::size_t count = usual) {
    return look(moving(count, change, damping_ratio), {mode_at(10, damping_ratio)});
}

/// One mode under a measured force, whose pole follows a law of its power and of time.
judged of_force(const law& change, double noise = 0.05, double loud_from = 0, double loud_to = 1,
                std::size_t count = usual) {
    const listed_mode mode = mode_at(10, 0.01);
    const series force = white(count, 1, 5);
    series given(count), out = white(count, noise, 6);
    std::complex<double> state = 0;
    for (std::size_t t = 0; t < count; ++t) {
        const double time = static_cast<double>(t) / static_cast<double>(count);
        given[t] = time >= loud_from && time < loud_to ? force[t] : 0.001 * force[t];
        out[t] += state.real();
        const double moved = change(std::norm(state), time - 0.5);
        state = discrete_pole(mode_at(10 * (1 + moved), 0.01), 1 / sample_rate) * state +
                std::complex<double>(0.04, 0.05) * given[t];
    }
    judged found;
    found.work.set = record_of({given, out}, 1);
    found.work.context.outputs = {"a"};
    make_modal_model({mode}, sample_rate, found.work);
    fit_records(found.work.set, found.work.model, found.work.context);
    remark_unsteady({mode}, sample_rate, found.work);
    return found;
}

} // namespace

void setUp() {}
void tearDown() {}

static void a_steady_mode_is_steady() {
    TEST_ASSERT_TRUE(!of_noise(steady).level() && !of_noise(steady).drift());
    TEST_ASSERT_TRUE(!of_force(steady).level() && !of_force(steady).drift());
}

/// Softer and stiffer, with and without a measured force.
/// Softer and stiffer, a fifth of the bandwidth for the mean power.
static void a_frequency_moves_with_the_level() {
    for (const double way : {-1.0, 1.0}) {
        const judged found = of_force(with_level(way * 0.2 * width));
        TEST_ASSERT_TRUE(found.level() && !found.drift());
        TEST_ASSERT_TRUE(contains(warning(found.work, "level_dependent"), way < 0 ? ": -0." : ": +0."));
        TEST_ASSERT_TRUE(contains(warning(found.work, "level_dependent"), "at 10 Hz"));
    }
}

/// From the beginning to the end: a bandwidth and a half under chance forces, a tenth where the force is measured.
static void a_frequency_drifts() {
    const auto percent = [](const judged& found) {
        const std::string text = warning(found.work, "time_varying");
        return text.empty() || found.level() ? 0 : std::stod(text.substr(text.find(": ") + 2));
    };
    for (const double way : {-1.0, 1.0}) {
        TEST_ASSERT_DOUBLE_WITHIN(0.6, way * 3, percent(of_noise(with_time(way * 1.5 * width), 0.01, long_enough)));
        TEST_ASSERT_DOUBLE_WITHIN(0.03, way * 0.2, percent(of_force(with_time(way * 0.1 * width))));
    }
}

/// Of four samples a period: that of an output belongs to the samples of that output at that instant, the quiet one included.
static void outputs_are_seen_at_one_instant() {
    const listed_mode mode = mode_at(64, 0.01, {1.0, {0.0, 0.5}});
    const series force = white(usual, 1, 5);
    series one = white(usual, 0.05, 6), other = white(usual, 0.002, 7);
    std::complex<double> state = 0;
    for (std::size_t t = 0; t < usual; ++t) {
        one[t] += state.real();
        other[t] -= 0.5 * state.imag();
        const double drift = 0.1 * width * (static_cast<double>(t) / usual - 0.5);
        state = discrete_pole(mode_at(64 * (1 + drift), 0.01), 1 / sample_rate) * state +
                std::complex<double>(0.04, 0.05) * force[t];
    }
    judged found;
    found.work.set = record_of({force, one, other}, 1);
    found.work.context.outputs = {"a", "b"};
    make_modal_model({mode}, sample_rate, found.work);
    fit_records(found.work.set, found.work.model, found.work.context);
    remark_unsteady({mode}, sample_rate, found.work);
    const std::string text = warning(found.work, "time_varying");
    TEST_ASSERT_FALSE(text.empty());
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.2, std::stod(text.substr(text.find(": ") + 2)));
}

/// A fiftieth of the bandwidth is not worth a word, however sure it is.
static void a_small_change_is_not_worth_a_word() {
    TEST_ASSERT_FALSE(of_force(with_time(0.016 * width), 1e-5).drift());
    TEST_ASSERT_TRUE(of_force(with_time(0.026 * width), 1e-5).drift());
}

/// Damping above a tenth, a neighbour within four bandwidths, a mode that is not in the model, one that hardly shows, a force that
/// lasts for less than half of the time.
static void what_cannot_be_judged_is_not() {
    const series broad = moving(long_enough, with_time(0.24), 0.08);
    TEST_ASSERT_TRUE(look(broad, {mode_at(10, 0.08)}).drift());
    TEST_ASSERT_FALSE(look(broad, {mode_at(10, 0.101)}).drift());
    const series drifting = moving(long_enough, with_time(1.5 * width));
    TEST_ASSERT_FALSE(look(drifting, {mode_at(10, 0.01), mode_at(10.79, 0.01)}).drift());
    TEST_ASSERT_TRUE(look(drifting, {mode_at(10, 0.01), mode_at(10.81, 0.01)}).drift());
    listed_mode outside = mode_at(10, 0.01);
    outside.in_model = false;
    TEST_ASSERT_FALSE(look(drifting, {outside}).drift());
    TEST_ASSERT_TRUE(of_force(with_time(width), 0.3).drift() && !of_force(with_time(width), 3).drift());
    TEST_ASSERT_TRUE(of_force(with_time(2 * width), 0.05, 0.2, 0.8).drift());
    TEST_ASSERT_FALSE(of_force(with_time(2 * width), 0.05, 0.3, 0.7).drift());
}

/// A pump a bandwidth away, eight times as strong as the mode: the louder both are together, the more it turns the phase.
static void a_tone_beside_a_mode_is_no_law_of_its_level() {
    series output = moving(long_enough, steady);
    for (std::size_t t = 0; t < output.size(); ++t)
        output[t] += 6 * std::cos(2 * M_PI * 10.2 / sample_rate * static_cast<double>(t));
    listed_mode tone = mode_at(10.2, 1e-5);
    tone.in_model = false;
    const auto with = [&](const char* code) {
        judged out;
        out.work.set = record_of({output});
        out.work.context.verdicts = {{true, 1, {}, false}, {false, 1, {code}, false}};
        remark_unsteady({mode_at(10, 0.01), tone}, sample_rate, out.work);
        return out.level();
    };
    TEST_ASSERT_TRUE(with("few_runs"));
    TEST_ASSERT_FALSE(with("tone"));
}

/// Twelve blocks of ten periods of one weight, 256 samples each.
static void few_blocks_show_no_slope() {
    TEST_ASSERT_FALSE(of_force(with_time(width), 1e-5, 0, 1, 11 * 256).drift());
    TEST_ASSERT_TRUE(of_force(with_time(width), 1e-5, 0, 1, 40 * 256).drift());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_steady_mode_is_steady);
    RUN_TEST(a_frequency_moves_with_the_level);
    RUN_TEST(a_frequency_drifts);
    RUN_TEST(outputs_are_seen_at_one_instant);
    RUN_TEST(a_small_change_is_not_worth_a_word);
    RUN_TEST(what_cannot_be_judged_is_not);
    RUN_TEST(a_tone_beside_a_mode_is_no_law_of_its_level);
    RUN_TEST(few_blocks_show_no_slope);
    return UNITY_END();
}
