// SPDX-License-Identifier: MIT
// Lines told from modes, on vibrations made sample by sample: a force that drives with a sine and its odd multiples, as a
// shaking table does, and a structure of one mode, which is a mode wherever it lies, on a multiple too.
#include "consensus/lines.hpp"

#include <cmath>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double fs = 120, drive = 1, damping = 0.01;
constexpr std::size_t count = 9600, multiples = 13;

record_level one_record() {
    record_level level;
    level.fs_hz = fs;
    level.top = 0.48;
    level.samples = count;
    level.records.emplace_back();
    return level;
}

/// What a mode is multiplied with from sample to sample.
std::complex<double> pole_of(double hz, double zeta) {
    return std::exp(2 * M_PI * hz / fs * std::complex<double>(-zeta, std::sqrt(1 - zeta * zeta)));
}

/// Force and acceleration of one mode; the drive runs in the middle of the record only.
std::vector<record_level> table_test(double mode_hz, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    sample_rows& rows = level.records.front();
    const double dt = 1 / fs;
    const std::complex<double> pole = pole_of(mode_hz, damping);
    std::complex<double> state = 0;
    double phase = 0;
    for (std::size_t i = 0; i < count; ++i) {
        phase += 2 * M_PI * drive * (1 + 0.003 * normal(random)) * dt;
        double force = 0.05 * normal(random);
        if (i > count / 6 && i < count - count / 6)
            for (std::size_t n = 1; n <= multiples; n += 2) force += std::sin(static_cast<double>(n) * phase + n) * 0.4;
        state = pole * state + force;
        rows.push_back(force);
        rows.push_back(force + 0.3 * state.imag() + 0.02 * normal(random));
    }
    return {level};
}

/// Two outputs beside each other: a hit after some silence, or noise all the time, of one mode; a line with it.
record_level answered(double mode_hz, double mode_damping, bool hit, double line_hz, double line, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    sample_rows& rows = level.records.front();
    const std::complex<double> pole = pole_of(mode_hz, mode_damping);
    std::complex<double> state = 0;
    double square = 0;
    for (std::size_t i = 0; i < count; ++i) {
        state = pole * state + (hit ? (i == 20 ? 1.0 : 0.0) : normal(random));
        square += std::norm(state) / 2 / count;
        rows.insert(rows.end(), {state.imag(), -0.5 * state.imag()});
    }
    const double hum = 2 * M_PI * line_hz / fs;
    for (std::size_t i = 0; i < 2 * count; ++i)
        rows[i] =
            rows[i] / std::sqrt(square) + line * std::sin(hum * static_cast<double>(i / 2)) + 0.01 * normal(random);
    return level;
}

std::vector<consensus_mode> listed(const record_level& level, bool at_rest, std::vector<consensus_mode> modes) {
    mark_lines({level}, 0, 2, at_rest, modes);
    return modes;
}

consensus_mode pole(double frequency_hz, double damping_ratio, std::complex<double> second) {
    consensus_mode mode;
    mode.frequency_hz = frequency_hz;
    mode.damping_ratio = damping_ratio;
    mode.agreement = 1;
    mode.shape = {1.0, second};
    return mode;
}

std::vector<std::string> why(double mode_hz, double listed_hz, double listed_damping) {
    std::vector<consensus_mode> modes(1);
    modes[0].frequency_hz = listed_hz;
    modes[0].damping_ratio = listed_damping;
    modes[0].agreement = 1;
    modes[0].shape = {1.0};
    mark_lines(table_test(mode_hz, 7), 1, 1, false, modes);
    return modes[0].why;
}

} // namespace

void setUp() {}
void tearDown() {}

static void a_multiple_of_the_drive_is_no_mode() {
    for (const double line : {5.0, 9.0, 11.0}) {
        const auto codes = why(7.95, line, 0.008);
        TEST_ASSERT_EQUAL_UINT64(1, codes.size());
        TEST_ASSERT_EQUAL_STRING("harmonic", codes[0].c_str());
    }
}

static void a_mode_stays_one_wherever_it_lies() {
    for (const double mode : {7.95, 8.3, 9.0, 9.1, 20.3}) TEST_ASSERT_EQUAL_UINT64(0, why(mode, mode, damping).size());
}

/// Noise below 20 Hz, as a shaker's controller makes it, one mode, and a second force that is not measured, of the same band.
static std::vector<record_level> driven_below_20_hz(double mode_hz) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    constexpr int half = 300;
    std::vector<double> taps, noise[2];
    for (int k = -half; k <= half; ++k)
        taps.push_back((k ? std::sin(2 * M_PI * 20 / fs * k) / (M_PI * k) : 40 / fs) *
                       (0.5 + 0.5 * std::cos(M_PI * k / (half + 1))));
    for (auto& one : noise)
        for (std::size_t i = 0; i < count + taps.size(); ++i) one.push_back(normal(random));
    const std::complex<double> pole = pole_of(mode_hz, damping);
    std::complex<double> state = 0;
    for (std::size_t i = 0; i < count; ++i) {
        double force[2] = {0, 0};
        for (std::size_t k = 0; k < taps.size(); ++k)
            for (int c = 0; c < 2; ++c) force[c] += taps[k] * noise[c][i + k];
        state = pole * state + force[0] + 0.1 * force[1];
        level.records.front().push_back(force[0] + 1e-4 * normal(random));
        level.records.front().push_back(0.1 * state.imag() + 0.1 * force[1] + 1e-3 * normal(random));
    }
    return {level};
}

static std::vector<std::string> why_below_20_hz(double mode_hz, double listed_hz) {
    std::vector<consensus_mode> modes = {pole(listed_hz, damping, 1)};
    modes[0].shape = {1.0};
    mark_lines(driven_below_20_hz(mode_hz), 1, 1, false, modes);
    return modes[0].why;
}

static void where_the_force_ends_is_no_mode() {
    const auto codes = why_below_20_hz(8, 20);
    TEST_ASSERT_EQUAL_UINT64(1, codes.size());
    TEST_ASSERT_EQUAL_STRING("band_edge", codes[0].c_str());
    for (const double mode : {8.0, 19.5, 20.0}) TEST_ASSERT_EQUAL_UINT64(0, why_below_20_hz(mode, mode).size());
}

/// In each output the mode beside it makes the amplitude of the line wander; along its shape that mode cancels.
static void a_line_is_seen_along_its_shape() {
    const auto modes = listed(answered(8, 0.02, false, 7.3, 0.3, 3), false, {pole(7.3, 2e-4, 1), pole(8, 0.02, -0.5)});
    TEST_ASSERT_EQUAL_UINT64(1, modes[0].why.size());
    TEST_ASSERT_EQUAL_STRING("tone", modes[0].why[0].c_str());
    TEST_ASSERT_EQUAL_UINT64(0, modes[1].why.size());
}

static void what_rings_after_silence_is_no_line() {
    const record_level level = answered(3, 8e-4, true, 11, 0, 5); // decays by a factor of three in the record
    TEST_ASSERT_EQUAL_UINT64(0, listed(level, false, {pole(3, 8e-4, -0.5)})[0].why.size());
    TEST_ASSERT_EQUAL_UINT64(0, listed(level, true, {pole(3, 8e-4, -0.5)})[0].why.size());
}

/// A hit after 10 s of quiet; what it answers is a strong mode, and a weak one of 3 Hz or a line of that amplitude throughout.
static record_level struck(bool line) {
    std::mt19937 random(9);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    const std::complex<double> strong_pole = pole_of(11, 2e-3), weak_pole = pole_of(3, 2e-4);
    std::complex<double> strong = 0, weak = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const double force = i == 1200 ? 1 : 0;
        strong = strong_pole * strong + 4 * force;
        weak = weak_pole * weak + 0.1 * force;
        const double other = line ? 0.1 * std::sin(2 * M_PI * 3 / fs * static_cast<double>(i)) : weak.imag();
        level.records.front().insert(
            level.records.front().end(),
            {force, strong.imag() + other + 0.003 * normal(random), -0.5 * strong.imag() + other});
    }
    return level;
}

/// Of many modes each has a small share of the motion: less than a line that a short quiet could hide.
static void a_weak_mode_that_begins_with_the_hit_is_no_line() {
    for (const bool line : {false, true}) {
        std::vector<consensus_mode> modes{pole(3, 2e-4, 1)};
        mark_lines({struck(line)}, 1, 2, true, modes);
        TEST_ASSERT_EQUAL_UINT64(line ? 1 : 0, modes[0].why.size());
    }
}

/// Endless for the record, 1.3 decay times: what falls as its damping says is a vibration, what stays is a line.
static void a_decay_is_no_line_however_short_the_record() {
    const record_level decay = answered(3, 5e-4, true, 11, 0, 6), line = answered(8, 0.02, false, 3, 0.5, 7);
    TEST_ASSERT_EQUAL_UINT64(0, listed(decay, false, {pole(3, 5e-4, -0.5)})[0].why.size());
    TEST_ASSERT_EQUAL_UINT64(1, listed(line, false, {pole(3, 5e-4, 1)})[0].why.size());
}

/// Of a mode that dies within three periods no more than one block a hit is left: nothing says that it is a line.
static void a_damped_mode_of_hits_is_no_line() {
    record_level level = one_record();
    level.records.clear();
    for (int hit = 0; hit < 15; ++hit) {
        std::complex<double> state = 1.0 + 0.05 * hit;
        sample_rows& rows = level.records.emplace_back();
        for (int i = 0; i < 96; ++i, state *= pole_of(4, 0.04))
            rows.insert(rows.end(), {state.imag(), -0.5 * state.imag()});
    }
    TEST_ASSERT_EQUAL_UINT64(0, listed(level, false, {pole(4, 0.04, -0.5)})[0].why.size());
}

/// A simple part of the rate in one output of two is the converter's; in both, or elsewhere, it is not.
static void a_part_of_the_rate_in_one_output_is_pickup() {
    const record_level level = answered(24, 0.02, false, 7, 0, 8);
    const auto code = [&](double hz, double second) { return listed(level, false, {pole(hz, 0.02, second)})[0].why; };
    TEST_ASSERT_EQUAL_STRING("pickup", code(fs / 5, 0.01)[0].c_str());
    TEST_ASSERT_EQUAL_UINT64(0, code(fs / 5, -0.5).size());
    TEST_ASSERT_EQUAL_UINT64(0, code(1.01 * fs / 5, 0.01).size());
    // its frequency, as the runs know it: a narrow one that they place here and there is not off the rate
    consensus_mode wandering = pole(1.002 * fs / 5, 5e-4, 0.01), wide = pole(1.002 * fs / 5, 0.02, 0.01);
    wandering.frequency_scatter_hz = wide.frequency_scatter_hz = 0.003 * fs / 5;
    TEST_ASSERT_EQUAL_STRING("pickup", listed(level, false, {wandering})[0].why[0].c_str());
    TEST_ASSERT_EQUAL_UINT64(0, listed(level, false, {wide})[0].why.size());
}

/// Noise of two seconds, again and again: what it drives has a constant amplitude, as a machine has. Of the machine no force is
/// measured.
static void what_a_repeated_force_explains_is_no_line() {
    std::mt19937 random(12);
    std::normal_distribution<double> normal;
    std::vector<double> period(static_cast<std::size_t>(2 * fs));
    for (double& x : period) x = normal(random);
    for (const bool measured : {true, false}) {
        record_level level = one_record();
        const std::complex<double> of_mode = pole_of(24, 0.008);
        std::complex<double> state = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double force = period[i % period.size()];
            state = of_mode * state + force;
            level.records.front().insert(level.records.front().end(),
                                         {measured ? force : normal(random), state.imag() + 0.1 * normal(random)});
        }
        std::vector<consensus_mode> modes = {pole(24, 0.008, 1)};
        modes[0].shape = {1.0};
        mark_lines({level}, 1, 1, false, modes);
        TEST_ASSERT_EQUAL_UINT64(measured ? 0 : 1, modes[0].why.size());
    }
}

/// A tone of 9 Hz, far stronger than the mode of 8 Hz, leaks into every block in which that mode is looked at.
static void a_mode_beside_a_strong_tone_is_no_line() {
    const record_level level = answered(8, 0.008, false, 9, 60, 13);
    TEST_ASSERT_EQUAL_UINT64(0, listed(level, false, {pole(8, 0.008, -0.5)})[0].why.size());
    TEST_ASSERT_EQUAL_STRING("tone", listed(level, false, {pole(9, 1e-4, 1)})[0].why[0].c_str());
}

/// Steps of somebody who jumps for a while: a tone with half of its frequency, which a mode beside it amplifies; or
/// noise there, of no phase to it.
static std::vector<std::string> why_below_a_tone(bool of_the_same, double hz, unsigned seed = 14) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    const std::complex<double> of_noise = pole_of(hz, 0.004);
    std::complex<double> state = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const double steps = 2 * M_PI * hz / fs * static_cast<double>(i);
        state = of_noise * state + 0.03 * normal(random);
        const double ramp = 0.2 + static_cast<double>(i) / count;
        const double below = of_the_same ? ramp * std::sin(steps) : 3 * state.imag();
        level.records.front().insert(level.records.front().end(), {below + std::cos(2 * steps) + 0.1 * normal(random),
                                                                   0.7 * below + std::cos(2 * steps)});
    }
    return listed(level, false, {pole(hz, 0.004, 0.7), pole(2 * hz, 1e-4, 1)})[0].why;
}

static void what_a_tone_is_a_multiple_of_is_no_mode() {
    for (const double hz : {8.0, 2.0}) { // of 192 periods, too
        TEST_ASSERT_EQUAL_UINT64(0, why_below_a_tone(false, hz).size());
        const auto codes = why_below_a_tone(true, hz);
        TEST_ASSERT_EQUAL_UINT64(1, codes.size());
        TEST_ASSERT_EQUAL_STRING("harmonic", codes[0].c_str());
    }
}

/// A hammer beside a machine of 8 Hz. What answers a hit at 8 Hz and at a mode of four times that has the phase of the hit to the
/// first and to the fourth power: no sign of the machine.
static void what_answers_hits_is_no_multiple() {
    std::mt19937 random(15);
    std::normal_distribution<double> normal;
    record_level level = one_record();
    const std::complex<double> of_mode = pole_of(32, 0.004), below = pole_of(8.2, 0.03);
    std::complex<double> mode = 0, other = 0;
    std::size_t next = 40;
    for (std::size_t i = 0; i < count; ++i) {
        const double force = i == next ? 1 : 0;
        if (i == next) next += 430 + static_cast<std::size_t>(100 * std::abs(normal(random)));
        mode = of_mode * mode + force;
        other = below * other + force;
        const double machine = 0.01 * std::sin(2 * M_PI * 8 / fs * static_cast<double>(i));
        level.records.front().insert(level.records.front().end(),
                                     {force, other.imag() + mode.imag() + machine + 1e-3 * normal(random),
                                      other.imag() - 0.6 * mode.imag() + machine + 1e-3 * normal(random)});
    }
    std::vector<consensus_mode> modes{pole(8, 1e-4, 1), pole(32, 0.004, -0.6)};
    modes[0].why = {"tone"};
    mark_lines({level}, 1, 2, false, modes);
    TEST_ASSERT_EQUAL_UINT64(0, modes[1].why.size());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_decay_is_no_line_however_short_the_record);
    RUN_TEST(a_damped_mode_of_hits_is_no_line);
    RUN_TEST(a_weak_mode_that_begins_with_the_hit_is_no_line);
    RUN_TEST(a_part_of_the_rate_in_one_output_is_pickup);
    RUN_TEST(a_line_is_seen_along_its_shape);
    RUN_TEST(what_a_repeated_force_explains_is_no_line);
    RUN_TEST(a_mode_beside_a_strong_tone_is_no_line);
    RUN_TEST(what_rings_after_silence_is_no_line);
    RUN_TEST(a_multiple_of_the_drive_is_no_mode);
    RUN_TEST(a_mode_stays_one_wherever_it_lies);
    RUN_TEST(where_the_force_ends_is_no_mode);
    RUN_TEST(what_a_tone_is_a_multiple_of_is_no_mode);
    RUN_TEST(what_answers_hits_is_no_multiple);
    return UNITY_END();
}
