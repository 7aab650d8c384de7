// SPDX-License-Identifier: MIT
// Accumulators beside each other: counts of records put together and taken apart, files at any time of a record,
// and both ways to the Gram matrix.
#include "accumulators.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

extern "C" void setUp() {}
extern "C" void tearDown() {}

using namespace okid_test;

namespace {

enum { M = 3, LAGS = 3 };

std::vector<double> noise(size_t count, std::uint64_t seed) {
    std::vector<double> out(count * M);
    for (double& x : out) {
        seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
        x = static_cast<double>(seed >> 11) / 4503599627370496.0 + 2; // far from 0: offsets matter
    }
    return out;
}

void expect_counts(const okid_accumulator_stats_t& a, const okid_accumulator_stats_t& b, int sign,
                   const okid_accumulator_stats_t& found) {
    TEST_ASSERT_EQUAL_INT64(a.samples + sign * b.samples, found.samples);
    TEST_ASSERT_EQUAL_INT64(a.missing + sign * b.missing, found.missing);
    TEST_ASSERT_EQUAL_INT64(a.gaps + sign * b.gaps, found.gaps);
    TEST_ASSERT_EQUAL_INT64(a.saturated + sign * b.saturated, found.saturated);
    TEST_ASSERT_EQUAL_INT64(a.rows + sign * b.rows, found.rows);
}

void counts_add_up_and_are_taken_off() {
    const okid_accumulator_config_t c = shape_of(0, OKID_SAMPLE_INT16, 5);
    std::vector<int16_t> codes(60 * M);
    for (size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<int16_t>(i % 37 == 0 ? 32767 : 100 * (i % 7));
    const sums a(c), b(c);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(a.self, codes.data(), 20));
    a.gap(3);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(a.self, codes.data(), 40));
    a.gap(1);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(b.self, codes.data(), 15));
    b.gap(7);
    TEST_ASSERT_EQUAL(OKID_WARN_SATURATED, okid_accumulator_add_i16(b.self, codes.data(), 9));
    const okid_accumulator_stats_t before = a.stats(), part = b.stats();
    TEST_ASSERT_TRUE(part.samples > 0 && part.missing > 0 && part.gaps > 0 && part.saturated > 0 && part.rows > 0);
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_merge(a.self, b.self));
    const okid_accumulator_stats_t merged = a.stats();
    expect_counts(before, part, 1, merged);
    expect_counts(part, {}, 1, b.stats());
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_remove(a.self, b.self, 1));
    expect_counts(merged, part, -1, a.stats());
}

void a_file_at_any_time_goes_on_as_the_record() {
    const std::vector<double> all = noise(40, 3);
    std::vector<int16_t> words(all.size());
    for (size_t i = 0; i < all.size(); ++i) words[i] = static_cast<int16_t>(10000 * (all[i] - 2));
    for (const okid_sample_t kind : {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16})
        for (int shape = 0; shape < 4; ++shape)
            for (size_t cut = 0; cut <= 40; ++cut) {
                const okid_accumulator_config_t c = shape_of(shape, kind, 5);
                const sums one(c), back(c);
                const auto add = [&](const sums& to, size_t first, size_t count) {
                    return kind == OKID_SAMPLE_DOUBLE
                               ? okid_accumulator_add(to.self, all.data() + first * M, count)
                               : okid_accumulator_add_i16(to.self, words.data() + first * M, count);
                };
                TEST_ASSERT_EQUAL(OKID_OK, add(one, 0, cut));
                if (cut % 5 == 4) one.gap(2);
                const bytes_t file = one.file();
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(back.self, file.data(), file.size()));
                TEST_ASSERT_TRUE(file == back.file());
                TEST_ASSERT_EQUAL(OKID_OK, add(one, cut, 40 - cut));
                TEST_ASSERT_EQUAL(OKID_OK, add(back, cut, 40 - cut));
                TEST_ASSERT_TRUE(one.file() == back.file());
            }
}

// R^T R is the Gram matrix: with units, offsets, gaps, samples that are missing; growing, in a window, fading.
void both_ways_to_the_gram_matrix() {
    constexpr size_t count = 300, n = M * (LAGS + 1);
    std::vector<double> all = noise(count, 5);
    all[M * 70 + 1] = std::numeric_limits<double>::quiet_NaN();
    const double scale[M] = {2, -0.5, 3}, offset[M] = {1, 20, -7};
    for (const int32_t batch : {1, 5, 32})
        for (int shape = 0; shape < 4; ++shape) {
            const okid_accumulator_config_t c = shape_of(shape, OKID_SAMPLE_DOUBLE, 5);
            const sums a(c);
            okid_square_root_config_t r = okid_square_root_defaults(1, M - 1, LAGS);
            r.batch = batch;
            r.block = c.block;
            r.slots = c.slots;
            r.forgetting = c.forgetting;
            const factors root(r);
            okid_accumulator_set_units(a.self, scale, offset);
            okid_square_root_set_units(root.self, scale, offset);
            for (size_t first = 0; first < count; first += 50) {
                TEST_ASSERT_TRUE(okid_accumulator_add(a.self, all.data() + first * M, 50) >= 0);
                TEST_ASSERT_TRUE(okid_square_root_add(root.self, all.data() + first * M, 50) >= 0);
                if (first == 150) a.gap(4);
                if (first == 150) root.gap(4);
                for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) {
                    double one[n * n], other[n * n], mean[M], other_mean[M];
                    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a.self, detrend, one, mean));
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(root.self, detrend, other, other_mean));
                    for (size_t i = 0; i < n * n; ++i)
                        TEST_ASSERT_DOUBLE_WITHIN(1e-10 * (1 + std::abs(one[n + 1])), one[i], other[i]);
                    for (size_t i = 0; i < M; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-10, mean[i], other_mean[i]);
                }
                expect_counts(a.stats(), {}, 1, root.stats());
            }
        }
}

// Factors whose rows fill their panels, and others: the triangles of a window are stacked row by row to their ends.
void factors_of_any_width() {
    const std::vector<double> all = noise(20, 7); // of one channel, 60 samples
    for (int32_t lags = 1; lags <= 16; ++lags) {
        okid_accumulator_config_t c = okid_accumulator_defaults(0, 1, lags);
        c.block = 7;
        c.slots = 4;
        const sums a(c);
        okid_square_root_config_t r = okid_square_root_defaults(0, 1, lags);
        r.block = 7;
        r.slots = 4;
        const factors root(r);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add(a.self, all.data(), all.size()));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(root.self, all.data(), all.size()));
        const auto n = static_cast<size_t>(lags + 1);
        std::vector<double> one(n * n), other(n * n);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(a.self, OKID_DETREND_NONE, one.data(), nullptr));
        TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(root.self, OKID_DETREND_NONE, other.data(), nullptr));
        for (size_t i = 0; i < n * n; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-11 * one[0], one[i], other[i]);
    }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(counts_add_up_and_are_taken_off);
    RUN_TEST(a_file_at_any_time_goes_on_as_the_record);
    RUN_TEST(both_ways_to_the_gram_matrix);
    RUN_TEST(factors_of_any_width);
    return UNITY_END();
}
