// SPDX-License-Identifier: MIT
// Which peaks of power are reported as explained by no mode: sines of known power in noise of known power.
#include "narrow_bands.hpp"
#include "record/record_fit.hpp"
#include "record/unexplained.hpp"

#include <unity.h>

using namespace okid_host;

namespace {

/// Noise of power 1 with sines of these powers.
series with_sines(std::size_t count, const std::vector<std::pair<double, double>>& hz_power, unsigned seed = 3) {
    series out = white(count, 1, seed);
    for (const auto& [hz, power] : hz_power) add(out, std::sqrt(2 * power), turning_at(hz, analytic(count, 1.0)));
    return out;
}

std::string said(const std::vector<series>& outputs, const std::vector<listed_mode>& listed = {},
                 const std::vector<mode_verdict>& verdicts = {}, std::pair<double, double> band = {0, 128}) {
    record_work work;
    work.set = record_of(outputs);
    work.context.verdicts = verdicts;
    work.context.band_hz = band;
    remark_unexplained(listed, sample_rate, work);
    return warning(work, "unexplained");
}

/// A peak of 40 Hz, and one mode: is the peak explained?
bool explained_by(double frequency_hz, double damping_ratio, const std::vector<std::string>& why) {
    static const std::vector<series> outputs = {with_sines(16384, {{40, 1}})};
    const std::string text = said(outputs, {mode_at(frequency_hz, damping_ratio)}, {verdict(why)});
    TEST_ASSERT_TRUE(text.empty() || contains(text, "40 Hz"));
    return text.empty();
}

} // namespace

void setUp() {}
void tearDown() {}

static void a_peak_is_reported_with_its_share() {
    TEST_ASSERT_TRUE(contains(said({with_sines(16384, {{40, 1}})}), "power at 40 Hz (50 %) that no mode"));
    TEST_ASSERT_TRUE(said({with_sines(16384, {})}).empty());
}

/// A hundredth of the power of its output, in nine lines of 4,097.
static void a_weak_peak_is_left_alone() {
    TEST_ASSERT_TRUE(contains(said({with_sines(65536, {{40, 0.0095}})}), "40 Hz"));
    TEST_ASSERT_TRUE(said({with_sines(65536, {{40, 0.006}})}).empty());
}

/// Ten times the median of the lines around it: of 65 lines a sine has a third of its power in one.
static void a_peak_stands_out_of_its_neighbourhood() {
    TEST_ASSERT_TRUE(contains(said({with_sines(1000, {{40, 0.35}})}), "40 Hz"));
    TEST_ASSERT_TRUE(said({with_sines(1000, {{40, 0.12}})}).empty());
}

/// Three lines of a sixteenth of a hertz, or three half bandwidths.
static void a_mode_explains_what_is_near() {
    for (const double way : {-1.0, 1.0}) {
        TEST_ASSERT_TRUE(explained_by(40 + way * 0.18, 0.0001, {}));
        TEST_ASSERT_FALSE(explained_by(40 + way * 0.20, 0.0001, {}));
        TEST_ASSERT_TRUE(explained_by(40 + way * 1.15, 0.01, {}));
        TEST_ASSERT_FALSE(explained_by(40 + way * 1.3, 0.01, {}));
    }
}

/// One that is believed, or named for what it is.
static void chance_explains_nothing() {
    for (const char* code : {"tone", "pickup", "harmonic", "split"}) TEST_ASSERT_TRUE(explained_by(40, 0.01, {code}));
    for (const char* code : {"few_runs", "noise_shape", "wide_sigma"}) {
        TEST_ASSERT_FALSE(explained_by(40, 0.01, {code}));
        TEST_ASSERT_TRUE(explained_by(40, 0.01, {code, "tone"}));
    }
}

static void only_the_band_is_looked_at() {
    const std::vector<series> outputs = {with_sines(16384, {{40, 1}, {60, 1}, {80, 1}})};
    const std::string text = said(outputs, {}, {}, {50, 70});
    TEST_ASSERT_TRUE(contains(text, "60 Hz") && !contains(text, "40 Hz") && !contains(text, "80 Hz"));
}

/// The strongest first, each once with the largest of its shares, five at most.
static void peaks_of_all_outputs_are_one_list() {
    TEST_ASSERT_TRUE(contains(said({with_sines(16384, {{40, 1}, {60, 2}}), with_sines(16384, {{40, 3}, {60, 0.5}}, 4)}),
                              "power at 40 Hz (67 %), 60 Hz (50 %) that"));
    std::vector<std::pair<double, double>> sines;
    for (int k = 0; k < 5; ++k) sines.emplace_back(20 * (k + 1), 1 - 0.1 * k);
    TEST_ASSERT_FALSE(contains(said({with_sines(16384, sines)}), "elsewhere"));
    sines.emplace_back(120, 0.3);
    const std::string text = said({with_sines(16384, sines)});
    TEST_ASSERT_TRUE(contains(text, "20 Hz (19 %), 40 Hz (17 %), 60 Hz") && contains(text, "and elsewhere") &&
                     !contains(text, "120 Hz"));
}

/// With a force: what the model leaves, where it leaves half of it at least.
static void what_a_model_explains_is_no_peak() {
    for (const double disturbance : {0.0, 1.0}) {
        const std::size_t count = 16384;
        const series force = white(count, 1, 7);
        series answer = white(count, 0.01, 8);
        const listed_mode mode = mode_at(40, 0.01);
        std::complex<double> state = 0;
        for (std::size_t t = 0; t < count; ++t) {
            answer[t] += state.real();
            state = discrete_pole(mode, 1 / sample_rate) * state + std::complex<double>(0.2, 0.1) * force[t];
        }
        add(answer, disturbance, turning_at(60, analytic(count, 1.0)));
        record_work work;
        work.set = record_of({force, answer}, 1);
        work.context.outputs = {"a"};
        make_modal_model({mode}, sample_rate, work);
        fit_records(work.set, work.model, work.context);
        work.context.verdicts = {verdict({"few_runs"})};
        remark_unexplained({mode}, sample_rate, work);
        const std::string text = warning(work, "unexplained");
        TEST_ASSERT_FALSE(contains(text, "40 Hz"));
        TEST_ASSERT_EQUAL(disturbance > 0, contains(text, "60 Hz"));
    }
}

/// At 40 Hz the force has a sine that passes to the output, which has another a quarter of a turn behind: a model leaves the latter.
static void half_of_a_peak_may_be_left() {
    for (const double other : {0.9, 1.15}) { // 0.45 and 0.57 of the power
        const std::size_t count = 16384;
        series force = white(count, 0.3, 7), answer = white(count, 0.01, 8);
        add(force, 1, turning_at(40, analytic(count, 1.0)));
        for (std::size_t t = 0; t < count; ++t) answer[t] += force[t];
        add(answer, other, turning_at(40, analytic(count, {0.0, 1.0})));
        record_work work;
        work.set = record_of({force, answer}, 1);
        work.context.outputs = {"a"};
        const listed_mode mode = mode_at(100, 0.01);
        make_modal_model({mode}, sample_rate, work);
        fit_records(work.set, work.model, work.context);
        work.context.verdicts = {verdict()};
        remark_unexplained({mode}, sample_rate, work);
        TEST_ASSERT_EQUAL(other > 1, contains(warning(work, "unexplained"), "40 Hz"));
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_peak_is_reported_with_its_share);
    RUN_TEST(a_weak_peak_is_left_alone);
    RUN_TEST(a_peak_stands_out_of_its_neighbourhood);
    RUN_TEST(a_mode_explains_what_is_near);
    RUN_TEST(chance_explains_nothing);
    RUN_TEST(only_the_band_is_looked_at);
    RUN_TEST(peaks_of_all_outputs_are_one_list);
    RUN_TEST(what_a_model_explains_is_no_peak);
    RUN_TEST(half_of_a_peak_may_be_left);
    return UNITY_END();
}
