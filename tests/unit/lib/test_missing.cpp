// SPDX-License-Identifier: MIT
// A sample with one channel that is no number, or a code at full scale, is missing as a whole, wherever it stands in a
// call: the state is that of a call before it, a gap of one, and a call behind it.
#include "accumulators.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using okid_test::bytes_t, okid_test::sums, okid_test::correlations;

constexpr size_t m = 3, count = 300; // the scan for what is missing goes 256 samples at a time

/// Where a missing sample is tried: around every border, in each channel.
const size_t places[] = {0, 1, 2, 7, 8, 9, 20, 254, 255, 256, 257, 298, 299};

okid_accumulator_config_t sums_of(okid_sample_t kind) {
    okid_accumulator_config_t c = okid_accumulator_defaults(1, 2, 2);
    c.sample = kind;
    c.edges = 1;
    c.saturated_missing = kind == OKID_SAMPLE_DOUBLE ? 0 : 1;
    return c;
}

okid_correlation_config_t correlations_of(okid_sample_t kind) {
    okid_correlation_config_t c = okid_correlation_defaults(1, 2, 2);
    c.sample = kind;
    c.slots = 8;
    c.buffer = 64;
    c.saturated_missing = kind == OKID_SAMPLE_DOUBLE ? 0 : 1;
    return c;
}

/// @param expected  status of the call with the bad sample; what was saturated is counted by it alone
template <class Object, class Config, class Number, class Add>
void split_or_whole(const Config& config, const std::vector<Number>& bad, okid_status_t expected, const Add& add) {
    std::vector<Number> good(m * count);
    for (size_t i = 0; i < good.size(); ++i) good[i] = static_cast<Number>(static_cast<int>(i * i % 201) - 100);
    for (const size_t at : places)
        for (size_t c = 0; c < m; ++c)
            for (const Number value : bad) {
                std::vector<Number> all = good;
                all[at * m + c] = value;
                const Object whole(config), split(config);
                TEST_ASSERT_EQUAL(expected, add(whole.self, all.data(), count));
                TEST_ASSERT_EQUAL(OKID_OK, add(split.self, good.data(), at));
                split.gap(1);
                TEST_ASSERT_EQUAL(OKID_OK, add(split.self, good.data() + (at + 1) * m, count - at - 1));
                bytes_t one = whole.file(), other = split.file();
                if (expected == OKID_WARN_SATURATED) { // nothing else differs: without the count, and the checksum
                    TEST_ASSERT_EQUAL(one.size(), other.size());
                    size_t different = 0;
                    for (size_t k = 0; k + 4 < one.size(); ++k) different += one[k] != other[k];
                    TEST_ASSERT_EQUAL(1, different);
                } else {
                    TEST_ASSERT_TRUE(one == other);
                }
            }
}

template <class Number> std::vector<Number> no_numbers() {
    using limits = std::numeric_limits<Number>;
    return {limits::quiet_NaN(), limits::infinity(), -limits::infinity()};
}

void numbers() {
    split_or_whole<sums>(sums_of(OKID_SAMPLE_DOUBLE), no_numbers<double>(), OKID_WARN_MISSING, okid_accumulator_add);
    split_or_whole<sums>(sums_of(OKID_SAMPLE_DOUBLE), no_numbers<float>(), OKID_WARN_MISSING, okid_accumulator_add_f32);
    split_or_whole<correlations>(correlations_of(OKID_SAMPLE_DOUBLE), no_numbers<double>(), OKID_WARN_MISSING,
                                 okid_correlation_add);
}

void codes() {
    const std::vector<int16_t> of_words = {INT16_MAX, INT16_MIN};
    const std::vector<int32_t> of_24_bits = {(1 << 23) - 1, -(1 << 23)}, of_32_bits = {INT32_MAX, INT32_MIN};
    split_or_whole<sums>(sums_of(OKID_SAMPLE_INT16), of_words, OKID_WARN_SATURATED, okid_accumulator_add_i16);
    split_or_whole<sums>(sums_of(OKID_SAMPLE_INT24), of_24_bits, OKID_WARN_SATURATED, okid_accumulator_add_i32);
    split_or_whole<sums>(sums_of(OKID_SAMPLE_INT32), of_32_bits, OKID_WARN_SATURATED, okid_accumulator_add_i32);
    split_or_whole<correlations>(correlations_of(OKID_SAMPLE_INT16), of_words, OKID_WARN_SATURATED,
                                 okid_correlation_add_i16);
    split_or_whole<correlations>(correlations_of(OKID_SAMPLE_INT24), of_24_bits, OKID_WARN_SATURATED,
                                 okid_correlation_add_i32);
    split_or_whole<correlations>(correlations_of(OKID_SAMPLE_INT32), of_32_bits, OKID_WARN_SATURATED,
                                 okid_correlation_add_i32);
}

/// The codes next to full scale are as good as any; a word beyond them is no code of 24 bits.
void the_bounds_of_codes() {
    const std::vector<int32_t> fine = {(1 << 23) - 2, -(1 << 23) + 1, 0}, above = {1 << 23, 0, 0},
                               below = {0, 0, -(1 << 23) - 1};
    const sums a(sums_of(OKID_SAMPLE_INT24));
    const correlations c(correlations_of(OKID_SAMPLE_INT24));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i32(a.self, fine.data(), 1));
    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_add_i32(c.self, fine.data(), 1));
    const bytes_t before[] = {a.file(), c.file()};
    for (const auto& outside : {above, below}) {
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_accumulator_add_i32(a.self, outside.data(), 1));
        TEST_ASSERT_EQUAL(OKID_ERR_RANGE, okid_correlation_add_i32(c.self, outside.data(), 1));
    }
    TEST_ASSERT_TRUE(before[0] == a.file()); // nothing was absorbed
    TEST_ASSERT_TRUE(before[1] == c.file());
    const std::vector<int16_t> words = {INT16_MAX - 1, INT16_MIN + 1, 0};
    const sums w(sums_of(OKID_SAMPLE_INT16));
    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_add_i16(w.self, words.data(), 1));
}

template <class Number, class Add> void factor_of(const std::vector<Number>& bad, const Add& add) {
    constexpr size_t n = m * 3;
    const okid_square_root_config_t c = okid_square_root_defaults(1, 2, 2);
    std::vector<Number> all(m * count);
    for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<Number>(static_cast<int>(i * i % 201) - 100);
    for (const size_t at : places)
        for (const Number value : bad) {
            std::vector<Number> holed = all;
            holed[at * m + at % m] = value;
            double gram[2][n * n];
            okid_accumulator_stats_t stats[2];
            for (int split = 0; split < 2; ++split) {
                const okid_test::factors one(c);
                if (split == 0) {
                    TEST_ASSERT_EQUAL(OKID_WARN_MISSING, add(one.self, holed.data(), count));
                } else {
                    TEST_ASSERT_EQUAL(OKID_OK, add(one.self, all.data(), at));
                    one.gap(1);
                    TEST_ASSERT_EQUAL(OKID_OK, add(one.self, all.data() + (at + 1) * m, count - at - 1));
                }
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(one.self, OKID_DETREND_NONE, gram[split], nullptr));
                stats[split] = one.stats();
            }
            for (size_t i = 0; i < n * n; ++i) TEST_ASSERT_TRUE(gram[0][i] == gram[1][i]);
            TEST_ASSERT_EQUAL_MEMORY(&stats[1], &stats[0], sizeof stats[0]);
        }
}

void factors() {
    factor_of(no_numbers<double>(), okid_square_root_add);
    factor_of(no_numbers<float>(), okid_square_root_add_f32);
    // whose square would overflow
    factor_of(std::vector<double>{std::ldexp(1.0, 497), -std::ldexp(1.0, 497)}, okid_square_root_add);
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(numbers);
    RUN_TEST(codes);
    RUN_TEST(the_bounds_of_codes);
    RUN_TEST(factors);
    return UNITY_END();
}
