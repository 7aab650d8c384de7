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

/// Force and acceleration of one mode; the drive runs in the middle of the record only.
std::vector<record_level> table_test(double mode_hz, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    record_level level;
    level.fs_hz = fs;
    level.top = 0.48;
    level.samples = count;
    sample_rows& rows = level.records.emplace_back();
    const double w = 2 * M_PI * mode_hz, dt = 1 / fs;
    const std::complex<double> pole =
        std::exp(std::complex<double>(-damping, std::sqrt(1 - damping * damping)) * w * dt);
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

std::vector<std::string> why(double mode_hz, double listed_hz, double listed_damping) {
    std::vector<consensus_mode> modes(1);
    modes[0].frequency_hz = listed_hz;
    modes[0].damping_ratio = listed_damping;
    modes[0].agreement = 1;
    modes[0].shape = {1.0};
    mark_lines(table_test(mode_hz, 7), 1, 1, modes);
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

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_multiple_of_the_drive_is_no_mode);
    RUN_TEST(a_mode_stays_one_wherever_it_lies);
    return UNITY_END();
}
