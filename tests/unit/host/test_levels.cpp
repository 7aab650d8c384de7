// SPDX-License-Identifier: MIT
// Streams of lower rates and of narrow bands, on sines and noise made sample by sample: what is kept, what is kept out, where a
// band ends, and when a stream is too short.
#include "consensus/levels.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr double fs = 1000;

using wave = std::function<double(double)>; // of time, s

bool is_missing(double x) { return !(x == x); }

sample_rows sampled(std::size_t count, const std::vector<wave>& channels) {
    sample_rows out;
    for (std::size_t i = 0; i < count; ++i)
        for (const wave& channel : channels) out.push_back(channel(static_cast<double>(i) / fs));
    return out;
}

wave sine(double hz, double phase = 0, double amplitude = 1) {
    return [=](double t) { return amplitude * std::sin(2 * M_PI * hz * t + phase); };
}

std::vector<record_level> levels_of(const sample_rows& rows, std::size_t m, bool at_rest = false, int decimate = 1) {
    std::vector<double> scale;
    return make_levels({rows}, 0, m, fs, at_rest, decimate, scale);
}

/// The complex amplitude of a sine in a channel of the first record, under a Hann window.
std::complex<double> amplitude(const record_level& level, std::size_t m, std::size_t channel, double hz) {
    const sample_rows& rows = level.records.front();
    const std::size_t count = rows.size() / m;
    std::complex<double> sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const double at = static_cast<double>(i), hann = 1 - std::cos(2 * M_PI * at / static_cast<double>(count));
        sum += hann * rows[i * m + channel] * std::polar(1.0, -2 * M_PI * hz / level.fs_hz * at);
    }
    return 2.0 * sum / static_cast<double>(count);
}

std::size_t count_of(const record_level& level, std::size_t m) { return level.records.front().size() / m; }

/// White noise with what lies above `corner` (share of the rate) at this share of the power; windowed sinc, 80 dB.
sample_rows noise(double corner, double power_above, unsigned seed) {
    constexpr int half = 400;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> white(10000 + 2 * half);
    for (double& x : white) x = normal(random);
    sample_rows out;
    for (std::size_t i = half; i + half < white.size(); ++i) {
        double low = 0;
        for (int k = -half; k <= half; ++k) {
            const double x = M_PI * k, edge = (k + half) * M_PI / half;
            const double window = 0.42 - 0.5 * std::cos(edge) + 0.08 * std::cos(2 * edge); // Blackman
            low += (k == 0 ? 2 * corner : std::sin(2 * corner * x) / x) * window *
                   white[i - static_cast<std::size_t>(k + half) + half];
        }
        out.push_back(low + std::sqrt(power_above) * (white[i] - low));
    }
    return out;
}

record_level first_level(std::size_t count, const wave& of, double top = 0.48) {
    record_level out = levels_of(sampled(count, {of}), 1).front();
    out.top = top;
    return out;
}

bool shows(const record_level& first, int factor, double hz) {
    return !zoomed_level(first, 1, factor, hz, false).records.empty();
}

} // namespace

void setUp() {}
void tearDown() {}

/// Below 0.42 of a rate a vibration keeps amplitude and phase between channels, above 0.55 nothing is left of it.
static void a_lower_rate_keeps_what_it_can_hold() {
    for (const bool at_rest : {false, true}) {
        const auto levels = levels_of(sampled(20000, {sine(60), sine(60, 1, 3), sine(140)}), 3, at_rest);
        TEST_ASSERT_EQUAL_UINT64(5, levels.size());
        for (std::size_t k = 0; k < 3; ++k) { // 60 Hz of 1000, 500, 250
            TEST_ASSERT_EQUAL_DOUBLE(fs / std::pow(2, k), levels[k].fs_hz);
            const auto a = amplitude(levels[k], 3, 0, 60), b = amplitude(levels[k], 3, 1, 60);
            TEST_ASSERT_DOUBLE_WITHIN(2e-3, std::sqrt(2), std::abs(a)); // of unit spread
            TEST_ASSERT_DOUBLE_WITHIN(2e-3, 1, std::arg(b / a));
        }
        for (const double x : levels[2].records[0]) TEST_ASSERT_TRUE(std::abs(x) < 2);
        double most = 0; // 140 Hz at 250 a second, behind the silence that the filter begins in
        for (std::size_t i = at_rest ? 100 : 0; i < count_of(levels[2], 3); ++i)
            most = std::max(most, std::abs(levels[2].records[0][3 * i + 2]));
        TEST_ASSERT_TRUE(most < 2e-3);
    }
}

/// A filter of 128 samples: 700 of half the rate need 1,526, of which silence before the record gives 64.
static void a_rate_needs_700_samples() {
    for (const auto& [count, at_rest, levels] : {std::tuple<std::size_t, bool, std::size_t>{1526, false, 2},
                                                 {1525, false, 1},
                                                 {1462, true, 2},
                                                 {1461, true, 1}}) {
        const auto made = levels_of(sampled(count, {sine(60)}), 1, at_rest);
        TEST_ASSERT_EQUAL_UINT64(levels, made.size());
        TEST_ASSERT_EQUAL_INT64(static_cast<long long>(count), made[0].samples);
        if (levels > 1) TEST_ASSERT_EQUAL_INT64(700, made[1].samples);
    }
    TEST_ASSERT_EQUAL_UINT64(most_levels, levels_of(sampled(200'000, {sine(60)}), 1).size());
}

/// A gap that is too long to be bridged takes those samples with it whose filter meets it, of its channel; counted are complete ones.
static void what_meets_a_missing_sample_is_missing() {
    sample_rows rows = sampled(4000, {sine(60), sine(70)});
    for (std::size_t n = 2000; n < 2011; ++n) rows[2 * n + 1] = NAN;
    const auto levels = levels_of(rows, 2);
    TEST_ASSERT_EQUAL_INT64(3989, levels[0].samples);
    std::size_t missing = 0;
    for (std::size_t i = 0; i < count_of(levels[1], 2); ++i) {
        const double *row = &levels[1].records[0][2 * i], first = 2.0 * static_cast<double>(i); // of its 128 samples
        TEST_ASSERT_FALSE(is_missing(row[0]));
        TEST_ASSERT_EQUAL(first < 2011 && 2000 < first + 128, is_missing(row[1]));
        missing += is_missing(row[1]);
    }
    TEST_ASSERT_EQUAL_UINT64(69, missing);
    TEST_ASSERT_EQUAL_INT64(static_cast<long long>(count_of(levels[1], 2) - missing), levels[1].samples);
}

/// Each record less its own mean, each channel in units of its spread over all records; one that never moves stays zero.
static void records_are_centred_and_channels_scaled() {
    sample_rows one = {1, 7, 5, 7, NAN, 7}, other = {100, 7, 108, 7};
    std::vector<double> scale;
    const auto level = make_levels({one, other}, 1, 1, fs, false, 1, scale).front();
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sqrt((4 + 4 + 16 + 16) / 4.0), scale[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1, scale[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -2 / scale[0], level.records[0][0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 4 / scale[0], level.records[1][2]);
    TEST_ASSERT_EQUAL_DOUBLE(0, level.records[0][1]);
    TEST_ASSERT_TRUE(is_missing(level.records[0][4]));
    TEST_ASSERT_EQUAL_INT64(4, level.samples);
}

/// A row that lacks any of its channels is none, wherever it stands.
static void complete_rows_are_counted() {
    for (std::size_t at = 0; at < 12; ++at) {
        sample_rows rows = {1, 4, 2, 3, 1, 5, 7, 0, 3, 2, 6, 8};
        rows[at] = NAN;
        TEST_ASSERT_EQUAL_INT64(3, levels_of(rows, 3).front().samples);
    }
}

/// The band ends where a thousandth of the usual power is left, from 0.42 on where a tenth is: the filter of the record.
static void the_band_ends_where_the_power_does() {
    const struct {
        double corner, power_above, least, most;
    } cases[] = {{0.35, 3e-4, 0.34, 0.37},
                 {0.35, 3e-3, 0.415, 0.425},
                 {0.35, 0.3, 0.475, 0.485},
                 {0.43, 0.03, 0.42, 0.45},
                 {0.5, 1, 0.475, 0.485}};
    for (const auto& one : cases) {
        const double top = levels_of(noise(one.corner, one.power_above, 3), 1).front().top;
        TEST_ASSERT_TRUE(top > one.least && top < one.most);
    }
    std::vector<double> scale; // where there is a force, it alone says so
    const sample_rows force = noise(0.35, 3e-4, 3), response = noise(0.5, 1, 4);
    for (const bool swapped : {false, true}) {
        sample_rows rows;
        for (std::size_t i = 0; i < force.size(); ++i)
            rows.insert(rows.end(), {swapped ? response[i] : force[i], swapped ? force[i] : response[i]});
        const auto levels = make_levels({rows}, 1, 1, fs, false, 1, scale);
        TEST_ASSERT_TRUE(swapped ? levels[0].top > 0.475 : levels[0].top < 0.37);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.42, levels[1].top); // inside the pass band of the own filter
    }
    const auto fifth = levels_of(sampled(20000, {sine(60), sine(130)}), 2, false, 5);
    TEST_ASSERT_TRUE(fifth[0].fs_hz == 200 && fifth[0].top == 0.42 && fifth[1].fs_hz == 100);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, std::sqrt(2), std::abs(amplitude(fifth[0], 2, 0, 60)));
}

/// A band of 25 Hz at 50 samples a second: what lies inside stands folded, what lies outside is kept out.
static void a_narrow_band_stands_alone() {
    for (const auto& [hz, folded] : {std::pair{215.0, 15.0}, {232.0, 18.0}, {12.0, 12.0}}) {
        const auto level = zoomed_level(first_level(20000, sine(hz)), 1, 20, hz, false);
        TEST_ASSERT_TRUE(level.zoomed && level.fs_hz == 50 && level.band == static_cast<int>(hz / 25));
        TEST_ASSERT_DOUBLE_WITHIN(3e-3, std::sqrt(2), std::abs(amplitude(level, 1, 0, folded)));
        TEST_ASSERT_EQUAL_INT64(static_cast<long long>(count_of(level, 1)), level.samples);
        for (const double outside : {std::max(50.0, hz - 25), hz + 25}) {
            const auto other = zoomed_level(first_level(20000, sine(outside)), 1, 20, hz, false);
            for (const double x : other.records[0]) TEST_ASSERT_TRUE(std::abs(x) < 3e-3);
        }
    }
}

/// Four hundredths of the rate off both edges of a band; the lowest one from 0 to 0.42.
static void a_narrow_band_has_edges() {
    const record_level first = first_level(20000, sine(215));
    TEST_ASSERT_TRUE(!shows(first, 20, 201.9) && shows(first, 20, 202.1) && shows(first, 20, 222.9) &&
                     !shows(first, 20, 223.1));
    TEST_ASSERT_TRUE(!shows(first, 20, 226.9) && shows(first, 20, 227.1));
    TEST_ASSERT_TRUE(shows(first, 20, 0.1) && shows(first, 20, 20.9) && !shows(first, 20, 21.1));
}

/// 475 Hz end the band of 455 Hz; the record may end two hertz before, the room that both filters need.
static void a_narrow_band_ends_before_that_of_the_record() {
    TEST_ASSERT_TRUE(shows(first_level(20000, sine(455), 0.4731), 20, 455));
    TEST_ASSERT_FALSE(shows(first_level(20000, sine(455), 0.4729), 20, 455));
}

/// A filter of 2,560 samples in front of every twentieth; and a decay that is over before it settles is none to look at.
static void a_narrow_band_is_long_enough() {
    TEST_ASSERT_TRUE(shows(first_level(2560 + 20 * 699, sine(215)), 20, 215));
    TEST_ASSERT_FALSE(shows(first_level(2559 + 20 * 699, sine(215)), 20, 215));
    for (const double share : {0.09, 0.11}) {
        const double decay = -std::log(1 - share) / 2 / (1280 / fs);
        const auto first =
            first_level(60000, [decay](double t) { return std::exp(-decay * t) * std::sin(2 * M_PI * 215 * t); });
        TEST_ASSERT_EQUAL(share < 0.1, shows(first, 20, 215));
        TEST_ASSERT_FALSE(zoomed_level(first, 1, 20, 215, true).records.empty()); // silence is before it
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_lower_rate_keeps_what_it_can_hold);
    RUN_TEST(a_rate_needs_700_samples);
    RUN_TEST(what_meets_a_missing_sample_is_missing);
    RUN_TEST(records_are_centred_and_channels_scaled);
    RUN_TEST(complete_rows_are_counted);
    RUN_TEST(the_band_ends_where_the_power_does);
    RUN_TEST(a_narrow_band_stands_alone);
    RUN_TEST(a_narrow_band_has_edges);
    RUN_TEST(a_narrow_band_ends_before_that_of_the_record);
    RUN_TEST(a_narrow_band_is_long_enough);
    return UNITY_END();
}
