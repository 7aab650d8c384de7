// SPDX-License-Identifier: MIT
// Modes that a failing sensor shows by itself: two modes under a force at three outputs, and what else the third one says.
#include "narrow_bands.hpp"
#include "record/noisy_outputs.hpp"
#include "record/record_fit.hpp"

#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t samples = 20'000;
constexpr double beside = 30; // Hz, of a third mode

struct judged {
    std::vector<listed_mode> modes;
    record_work work;
    bool doubted(std::size_t k) const { return !work.context.verdicts[k].why.empty(); }
};

/// The outputs and a third mode of this shape, which the force drives or not. `unit` of the third output.
judged look(const std::vector<std::complex<double>>& third, double driven, double noise, double unit = 1) {
    const series force = white(samples, 1, 7);
    judged out;
    out.modes = {mode_at(10, 0.01, {1, 0.5, unit}), mode_at(20, 0.01, {0.5, 1, -unit}), mode_at(beside, 0.01, third)};
    std::vector<series> channels{force};
    for (unsigned o = 0; o < 3; ++o) channels.push_back(white(samples, 0.001, 8 + o));
    for (std::size_t k = 0; k < 3; ++k) {
        std::complex<double> state;
        for (std::size_t t = 0; t < samples; ++t) {
            for (std::size_t o = 0; o < 3; ++o) channels[1 + o][t] += (out.modes[k].shape[o] * state).real();
            state = discrete_pole(out.modes[k], 1 / sample_rate) * state + (k < 2 ? 0.1 : driven) * force[t];
        }
    }
    const series more = white(samples, noise * unit, 20);
    for (std::size_t t = 0; t < samples; ++t) channels[3][t] += more[t];
    out.work.set = record_of(channels, 1);
    remove_means(out.work.set);
    out.work.context.outputs = {"a", "b", "c"};
    out.work.context.verdicts.assign(3, verdict());
    out.work.scale = {1, 1, 1, unit};
    mark_of_noisy_outputs(out.modes, sample_rate, out.work);
    make_modal_model(out.modes, sample_rate, out.work);
    fit_records(out.work.set, out.work.model, out.work.context);
    remark_noisy_outputs(out.work.context);
    return out;
}

} // namespace

void setUp() {}
void tearDown() {}

static void what_only_a_noisy_output_shows_is_doubtful() {
    for (const double unit : {1.0, 1e-3, 1e3}) {
        const judged found = look({0, 0.45, unit}, 0, 1, unit);
        TEST_ASSERT_TRUE(found.doubted(2) && !found.modes[2].in_model);
        TEST_ASSERT_EQUAL_STRING("noisy_output", found.work.context.verdicts[2].why[0].c_str());
        TEST_ASSERT_FALSE(found.work.context.verdicts[2].confident);
        TEST_ASSERT_FALSE(found.doubted(0) || found.doubted(1));
        TEST_ASSERT_TRUE(contains(warning(found.work, "noisy_output"), "output \"c\" is much noisier than the rest"));
    }
}

/// The force explains this output, or another output shows the mode as well: a local mode is one.
static void a_local_mode_stays() {
    const judged sound = look({0, 0, 1}, 0.1, 0);
    TEST_ASSERT_TRUE(sound.modes[2].in_model && !sound.doubted(2));
    TEST_ASSERT_TRUE(warning(sound.work, "noisy_output").empty());
    const judged shared = look({0, 0.55, 1}, 0.1, 1);
    TEST_ASSERT_TRUE(shared.modes[2].in_model && !shared.doubted(2));
    TEST_ASSERT_FALSE(warning(shared.work, "noisy_output").empty());
}

/// Two outputs say nothing about which one is noisy.
static void three_outputs_are_compared() {
    result_context context;
    context.outputs = {"a", "b", "c"};
    context.simulation_percent = {99, 80};
    TEST_ASSERT_TRUE(noisy_outputs_of(context).which.empty());
    context.simulation_percent = {99, 98, 80};
    TEST_ASSERT_EQUAL_UINT64(1, noisy_outputs_of(context).which.size());
    TEST_ASSERT_EQUAL_UINT64(2, noisy_outputs_of(context).which[0]);
    context.simulation_percent = {99, 98, 86}; // 14 % is left
    TEST_ASSERT_TRUE(noisy_outputs_of(context).which.empty());
    context.simulation_percent = {99, 95, 76}; // less than five times as much
    TEST_ASSERT_TRUE(noisy_outputs_of(context).which.empty());
    context.simulation_percent = {99, 98, NAN};
    TEST_ASSERT_TRUE(noisy_outputs_of(context).which.empty());
}

/// Where no other mode is believed there is nothing to compare with.
static void the_only_mode_stays() {
    judged found = look({0, 0.2, 1}, 0.1, 1);
    found.modes.erase(found.modes.begin(), found.modes.begin() + 2);
    found.modes[0] = mode_at(beside, 0.01, {0.0, 0.0, 1.0});
    found.work.context.verdicts.assign(1, verdict());
    mark_of_noisy_outputs(found.modes, sample_rate, found.work);
    TEST_ASSERT_TRUE(found.modes[0].in_model && !found.doubted(0));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(what_only_a_noisy_output_shows_is_doubtful);
    RUN_TEST(a_local_mode_stays);
    RUN_TEST(three_outputs_are_compared);
    RUN_TEST(the_only_mode_stays);
    return UNITY_END();
}
