// SPDX-License-Identifier: MIT
// How much of a vibration measured forces explain: answers of poles made sample by sample, with neighbours, free decays and gaps.
#include "consensus/demodulation.hpp"
#include "consensus/explained_by_forces.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

using series = std::vector<double>;

constexpr double fs = 128, hz = 20, damping = 0.01;
constexpr std::size_t block = 256, blocks = 128; // half a hertz apart is one cycle of a block

series white(unsigned seed, std::size_t count = block * blocks) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    series out(count);
    for (double& x : out) x = normal(random);
    return out;
}

/// What a mode answers to a force, and its own vibration from the begin.
series answer(const series& force, double frequency_hz, double free = 0, double damping_ratio = damping) {
    const std::complex<double> pole =
        std::exp(2 * M_PI * frequency_hz / fs *
                 std::complex<double>(-damping_ratio, std::sqrt(1 - damping_ratio * damping_ratio)));
    std::complex<double> state = free;
    series out;
    for (const double each : force) {
        state = pole * state + each;
        out.push_back(state.imag());
    }
    return out;
}

series sum(series a, double factor, const series& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += factor * b[i];
    return a;
}

consensus_mode mode_at(double frequency_hz, double agreement = 1, double damping_ratio = damping) {
    consensus_mode out;
    out.frequency_hz = frequency_hz;
    out.damping_ratio = damping_ratio;
    out.agreement = agreement;
    return out;
}

/// Of the first mode, in one record of these forces.
double explained(const std::vector<series>& forces, const series& response, const std::vector<consensus_mode>& modes,
                 bool rings_on = false) {
    record_level level;
    level.fs_hz = fs;
    sample_rows rows;
    for (std::size_t t = 0; t < response.size(); ++t) {
        for (const series& force : forces) rows.push_back(force[t]);
        rows.push_back(response[t]);
    }
    level.records.push_back(rows);
    std::vector<std::complex<double>> seen;
    demodulate(response.size(), modes[0].frequency_hz / fs, block, [&](std::size_t t) { return response[t]; }, seen);
    return explained_by_forces(level, forces.size() + 1, forces.size(), rings_on, modes[0], modes, block, seen);
}

} // namespace

void setUp() {}
void tearDown() {}

static void an_answer_is_explained_and_noise_is_not() {
    const series force = white(1), other = white(2);
    const series driven = answer(force, hz), beside = answer(other, hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, driven, {mode_at(hz)}));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({other, force}, driven, {mode_at(hz)}));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({other, force}, sum(driven, -2, beside), {mode_at(hz)}));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0, explained({other}, driven, {mode_at(hz)}));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.5, explained({force}, sum(driven, 1, beside), {mode_at(hz)}));
}

/// Blocks in which a force or a response is missing are left out, whatever stands in the others.
static void missing_samples_cost_their_blocks() {
    series force = white(1);
    series response = answer(force, hz);
    for (const std::size_t at : {1000, 9000}) response[at] = NAN;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, response, {mode_at(hz)}));
    force.back() = NAN; // nothing comes behind it
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, response, {mode_at(hz)}));
}

/// Two that are less than half a cycle apart are one vibration to a block: what drives either explains both, if it is believed.
static void a_block_does_not_part_close_modes() {
    const series force = white(1);
    for (const double way : {-1.0, 1.0}) {
        const series of_other = answer(force, hz + way * 0.24);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, of_other, {mode_at(hz), mode_at(hz + way * 0.24)}));
        TEST_ASSERT_TRUE(explained({force}, of_other, {mode_at(hz), mode_at(hz + way * 0.24, 0.49)}) < 0.95);
        const series beyond = answer(force, hz + way * 0.26); // it leaks in, and is no part of the mode
        TEST_ASSERT_TRUE(explained({force}, beyond, {mode_at(hz), mode_at(hz + way * 0.26)}) < 0.5);
    }
}

/// Within two cycles: it is no part of what the mode shows, by the force or not. What is farther off is not looked at.
static void what_leaks_in_is_taken_off_first() {
    const series force = white(1);
    for (const double apart : {-0.99, -0.6, 0.6, 0.99}) {
        const series with_leak = sum(answer(force, hz), 1.5, answer(force, hz + apart));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, with_leak, {mode_at(hz), mode_at(hz + apart)}));
        TEST_ASSERT_TRUE(explained({force}, with_leak, {mode_at(hz), mode_at(hz + apart, 0.49)}) < 0.99);
    }
    for (const double apart : {-1.01, 1.01}) {
        const series with_leak = sum(answer(force, hz), 1.5, answer(force, hz + apart));
        const double alone = explained({force}, with_leak, {mode_at(hz)});
        TEST_ASSERT_EQUAL_DOUBLE(alone, explained({force}, with_leak, {mode_at(hz), mode_at(hz + apart)}));
    }
}

/// Neighbours are taken as long as there are more than two blocks to a number.
static void few_blocks_carry_few_numbers() {
    for (const std::size_t some : {4, 5}) {
        const series force = white(1, some * block);
        const double found = explained({force}, answer(force, hz + 0.2), {mode_at(hz), mode_at(hz + 0.2)});
        TEST_ASSERT_TRUE(some == 5 ? found > 0.99 : found < 0.99);
    }
    const series force = white(1, block);
    TEST_ASSERT_EQUAL_DOUBLE(
        0, explained({force}, answer(force, hz), {mode_at(hz)})); // of one block: nothing is left over
}

/// A record that begins in the middle of a vibration: what it begins with is no answer to the force, and all of it is nothing.
static void what_a_record_begins_with_is_taken_off() {
    const double lasting = 2e-4;
    const series force = white(1), none(force.size());
    const std::vector<consensus_mode> modes = {mode_at(hz, 1, lasting)};
    const series driven = answer(force, hz, 0, lasting), begun = answer(none, hz, 300, lasting);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1, explained({force}, sum(driven, 1, begun), modes, true));
    TEST_ASSERT_TRUE(explained({force}, sum(driven, 1, begun), modes, false) < 0.95);
    TEST_ASSERT_EQUAL_DOUBLE(0, explained({force}, begun, modes, true));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(an_answer_is_explained_and_noise_is_not);
    RUN_TEST(missing_samples_cost_their_blocks);
    RUN_TEST(a_block_does_not_part_close_modes);
    RUN_TEST(what_leaks_in_is_taken_off_first);
    RUN_TEST(few_blocks_carry_few_numbers);
    RUN_TEST(what_a_record_begins_with_is_taken_off);
    return UNITY_END();
}
