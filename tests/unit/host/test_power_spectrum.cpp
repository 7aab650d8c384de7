// SPDX-License-Identifier: MIT
// Power over frequency against its definition, and narrow bands folded to lower frequencies and back.
#include "consensus/spectrum.hpp"
#include "consensus/zoom.hpp"

#include <cmath>
#include <complex>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::size_t size = 16, channels = 3;

/// Numbers without a pattern, each record with an offset of its own.
std::vector<double> record_of(std::size_t count, int seed) {
    std::vector<double> out;
    for (std::size_t i = 0; i < count * channels; ++i)
        out.push_back(5.0 * seed + std::sin(1.7 * static_cast<double>(i * i) + seed));
    return out;
}

/// Adds the power of one segment, line by line of the sum that defines it.
void add_segment(const std::vector<double>& rows, std::size_t first, std::size_t channel, std::vector<double>& power) {
    double mean = 0;
    for (std::size_t i = 0; i < size; ++i) mean += rows[(first + i) * channels + channel] / size;
    for (std::size_t k = 0; k <= size / 2; ++k) {
        std::complex<double> sum = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const double turn = 2 * M_PI * static_cast<double>(i) / size;
            sum += (rows[(first + i) * channels + channel] - mean) * (0.5 - 0.5 * std::cos(turn)) *
                   std::polar(1.0, -turn * static_cast<double>(k));
        }
        power[k] += std::norm(sum);
    }
}

} // namespace

void setUp() {}
void tearDown() {}

/// Segments half over each other in every record, none across two of them, none of a record that is one sample short.
static void a_spectrum_is_the_mean_of_whole_segments() {
    const std::vector<std::vector<double>> records = {record_of(40, 1), record_of(15, 2), record_of(23, 3)};
    for (std::size_t c = 0; c < channels; ++c) {
        std::vector<double> expected(size / 2 + 1);
        for (const std::size_t first : {0, 8, 16, 24}) add_segment(records[0], first, c, expected);
        add_segment(records[2], 0, c, expected);
        const std::vector<double> found = power_spectrum(records, channels, c, size);
        TEST_ASSERT_EQUAL_UINT64(expected.size(), found.size());
        for (std::size_t k = 0; k < expected.size(); ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected[k] / 5, found[k]);
    }
    TEST_ASSERT_TRUE(power_spectrum({records[1]}, channels, 0, size).empty());
}

/// It costs the segments it lies in, of its own channel.
static void a_missing_sample_costs_its_segments() {
    std::vector<double> rows = record_of(32, 4);
    rows[20 * channels + 1] = NAN;
    std::vector<double> expected(size / 2 + 1);
    add_segment(rows, 0, 1, expected);
    const std::vector<double> found = power_spectrum({rows}, channels, 1, size);
    for (std::size_t k = 0; k < expected.size(); ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected[k], found[k]);
    rows[10 * channels + 1] = NAN;
    TEST_ASSERT_TRUE(power_spectrum({rows}, channels, 1, size).empty());
    TEST_ASSERT_FALSE(power_spectrum({rows}, channels, 2, size).empty());
}

/// Lines at 0, 1/16 .. 1/2 of the rate; both ends of a band belong to it.
static void a_band_holds_its_ends() {
    const std::vector<double> power = {1, 2, 4, 8, 16, 32, 64, 128, 256};
    TEST_ASSERT_EQUAL_DOUBLE((4 + 8 + 16) / 3.0, mean_power(power, 0.125, 0.25));
    TEST_ASSERT_EQUAL_DOUBLE(8, median_power(power, 0.125, 0.25));
    TEST_ASSERT_EQUAL_DOUBLE(8, mean_power(power, 0.126, 0.249));
    TEST_ASSERT_EQUAL_DOUBLE(16, median_power(power, 0.125, 0.3125)); // of an even number the upper one
    TEST_ASSERT_EQUAL_DOUBLE(511 / 9.0, mean_power(power, 0, 0.5));
    TEST_ASSERT_EQUAL_DOUBLE(256, mean_power(power, 0.5, 0.5));
    TEST_ASSERT_EQUAL_DOUBLE(0, mean_power(power, 0.13, 0.18));
    TEST_ASSERT_EQUAL_DOUBLE(0, median_power(power, 0.13, 0.18));
}

/// At 50 samples a second band 3 is 75 to 100 Hz, mirrored; band 2 is 50 to 75 Hz and only moved.
static void a_folded_mode_keeps_its_decay() {
    const zoom_band whole{50, 0}, moved{50, 2}, mirrored{50, 3};
    const double damping = 0.6, root = 0.8; // damped frequency over undamped: a sum that is exact
    const struct {
        zoom_band band;
        double damped_hz, folded_hz;
    } cases[] = {{whole, 12, 12}, {moved, 64, 14}, {mirrored, 80, 20}, {mirrored, 96, 4}};
    for (const auto& one : cases) {
        const double hz = one.damped_hz / root, decay_hz = damping * hz;
        double frequency_hz = hz, ratio = damping;
        one.band.fold(frequency_hz, ratio);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, std::hypot(one.folded_hz, decay_hz), frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, decay_hz, ratio * frequency_hz);
        one.band.unfold(frequency_hz, ratio);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, hz, frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, damping, ratio);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.damped_hz, one.band.unfolded(one.band.folded(one.damped_hz)));
    }
    const std::complex<double> entry(1, 2);
    TEST_ASSERT_TRUE(moved.turned(entry) == entry && mirrored.turned(entry) == std::conj(entry));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_spectrum_is_the_mean_of_whole_segments);
    RUN_TEST(a_missing_sample_costs_its_segments);
    RUN_TEST(a_band_holds_its_ends);
    RUN_TEST(a_folded_mode_keeps_its_decay);
    return UNITY_END();
}
