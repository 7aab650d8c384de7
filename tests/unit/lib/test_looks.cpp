// SPDX-License-Identifier: MIT
// Neither looks at the results nor the buffer, the cut into calls or the FFT change what is summed: not a bit of codes.
// What is read back from a file goes on as if nothing had happened.
#include "accumulators.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using okid_test::bytes_t;

std::uint64_t state = 1;

/// 0 .. 2^32 - 1
std::uint32_t draw() {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<std::uint32_t>(state >> 32);
}

struct samples {
    std::vector<double> numbers;
    std::vector<int16_t> words;
    std::vector<int32_t> longs;

    /// Codes at or near full scale, odd, of either sign, which is where sums leave their words first.
    samples(okid_sample_t kind, size_t count, bool loud) {
        const int bits = kind == OKID_SAMPLE_INT16 ? 16 : kind == OKID_SAMPLE_INT24 ? 24 : 32;
        const auto top = static_cast<std::int64_t>((std::uint64_t{1} << (bits - 1)) - 3);
        for (size_t i = 0; i < count; ++i) {
            const std::uint32_t x = draw();
            const std::int64_t code = loud ? (x % 9 == 0 ? -top : top) : static_cast<std::int64_t>(x % 2001) - 1000;
            numbers.push_back(std::sin(static_cast<double>(x)));
            words.push_back(static_cast<int16_t>(bits == 16 ? code : 0));
            longs.push_back(static_cast<int32_t>(code));
        }
    }
};

template <class Object, class Add, class AddWords, class AddLongs>
okid_status_t feed(Object* self, okid_sample_t kind, const samples& from, size_t first, size_t count, size_t m, Add add,
                   AddWords add_words, AddLongs add_longs) {
    if (kind == OKID_SAMPLE_DOUBLE) return add(self, from.numbers.data() + first * m, count);
    if (kind == OKID_SAMPLE_INT16) return add_words(self, from.words.data() + first * m, count);
    return add_longs(self, from.longs.data() + first * m, count);
}

struct sums : okid_test::sums {
    using okid_test::sums::sums;
    size_t m() const { return static_cast<size_t>(config.n_u + config.n_y); }
    void add(const samples& from, size_t first, size_t count) const {
        TEST_ASSERT_TRUE(feed(self, config.sample, from, first, count, m(), okid_accumulator_add,
                              okid_accumulator_add_i16, okid_accumulator_add_i32) >= 0);
    }
    std::vector<double> gram(okid_detrend_t detrend) const {
        const size_t n = m() * static_cast<size_t>(config.lags + 1);
        std::vector<double> out(n * n);
        TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(self, detrend, out.data(), nullptr));
        return out;
    }
};

const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};

void the_buffer_changes_no_bit() {
    constexpr size_t count = 3000;
    for (const okid_sample_t kind : kinds)
        for (const bool loud : {false, true}) {
            okid_accumulator_config_t c = okid_accumulator_defaults(1, 1, 2);
            c.sample = kind;
            const samples all(kind, 2 * count, loud);
            const sums usual(c);
            usual.add(all, 0, count);
            for (const int32_t buffer : {1, 37, 100, 127, 128, 129, 1000}) {
                c.buffer = buffer;
                const sums other(c);
                for (size_t n = 0; n < count;) { // in calls of any length
                    const size_t some = std::min<size_t>(1 + draw() % 300, count - n);
                    other.add(all, n, some);
                    n += some;
                }
                TEST_ASSERT_TRUE(usual.file() == other.file());
            }
        }
}

void looks_change_no_bit() {
    constexpr size_t count = 700;
    for (const okid_sample_t kind : kinds)
        for (int shape = 0; shape < 4; ++shape) {
            okid_accumulator_config_t c = okid_test::shape_of(shape, kind, 50);
            if (shape == 2) c.slots = 4;
            const samples all(kind, 3 * count, false);
            const sums alone(c), looked_at(c);
            for (size_t n = 0; n < count; n += 35) {
                for (const sums* each : {&alone, &looked_at}) {
                    each->add(all, n, 35);
                    if (n == 350) each->gap(2);
                }
                for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) {
                    double energy[3];
                    const std::vector<double> gram = looked_at.gram(detrend);
                    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(looked_at.self, detrend, energy));
                    for (size_t r = 0; r < 3; ++r)
                        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * std::abs(gram[13 * r]) + 1e-9, gram[13 * r], energy[r]);
                }
                (void)looked_at.file();
            }
            TEST_ASSERT_TRUE(alone.file() == looked_at.file());
        }
}

void the_fft_changes_no_bit_of_codes_and_little_of_doubles() {
    constexpr size_t count = 9000;
    for (const okid_sample_t kind : {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16})
        for (const int32_t n_y : {1, 3, 7, 11})
            for (int what = 0; what < 3; ++what) { // quiet, loud, silent
                okid_accumulator_config_t c = okid_accumulator_defaults(1, n_y, 60);
                c.sample = kind;
                c.edges = 1;
                samples all(kind, static_cast<size_t>(1 + n_y) * count, what == 1);
                if (what == 2) {
                    std::fill(all.numbers.begin(), all.numbers.end(), 0.0);
                    std::fill(all.words.begin(), all.words.end(), int16_t{0});
                }
                const sums direct(c);
                c.bulk = 1;
                const sums bulk(c);
                direct.add(all, 0, count);
                bulk.add(all, 0, 4000);
                okid_accumulator_stats_t stats;
                okid_accumulator_stats(bulk.self, &stats);
                TEST_ASSERT_EQUAL_INT64(4000 - 60, stats.rows);
                bulk.add(all, 4000, count - 4000);
                TEST_ASSERT_TRUE(kind == OKID_SAMPLE_DOUBLE || direct.file() == bulk.file());
                const std::vector<double> a = direct.gram(OKID_DETREND_NONE), b = bulk.gram(OKID_DETREND_NONE);
                for (size_t i = 0; i < a.size(); ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 + a[0]), a[i], b[i]);
            }
}

struct correlations : okid_test::correlations {
    using okid_test::correlations::correlations;
    void add(const samples& from, size_t first, size_t count) const {
        const auto m = static_cast<size_t>(config.n_u + config.n_y);
        TEST_ASSERT_TRUE(feed(self, config.sample, from, first, count, m, okid_correlation_add,
                              okid_correlation_add_i16, okid_correlation_add_i32) >= 0);
    }
    void look(okid_detrend_t detrend) const {
        bytes_t room(okid_correlation_sums_memsize(self));
        okid_correlation_sums_t found;
        TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_sums(self, detrend, &found, room.data(), room.size()));
    }
};

void correlations_are_not_changed_by_looks_nor_codes_by_the_buffer() {
    constexpr size_t count = 2000;
    for (const okid_sample_t kind : kinds)
        for (const int32_t block : {0, 300})
            for (const bool loud : {false, true}) {
                okid_correlation_config_t c = okid_correlation_defaults(1, 2, 40);
                c.own_lags = 3;
                c.sample = kind;
                c.block = block;
                c.slots = 3;
                const samples all(kind, 3 * count, loud);
                const correlations alone(c), looked_at(c);
                for (size_t n = 0; n < count; n += 125) {
                    for (const correlations* each : {&alone, &looked_at}) {
                        each->add(all, n, 125);
                        if (n == 1000) each->gap(0);
                    }
                    for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) looked_at.look(detrend);
                }
                const bytes_t file = alone.file();
                TEST_ASSERT_TRUE(file == looked_at.file());
                for (const int32_t buffer : {1, 7, 256}) {
                    if (kind == OKID_SAMPLE_DOUBLE) continue;
                    c.buffer = buffer;
                    const correlations other(c);
                    other.add(all, 0, 1125);
                    other.gap(0);
                    other.add(all, 1125, count - 1125);
                    TEST_ASSERT_TRUE(file == other.file());
                }
            }
}

/// Every run there is room for is closed; and one that is not.
void what_is_read_back_goes_on() {
    for (const okid_sample_t kind : kinds)
        for (const int32_t slots : {1, 2}) {
            okid_correlation_config_t c = okid_correlation_defaults(1, 1, 5);
            c.sample = kind;
            c.slots = slots;
            const samples all(kind, 2 * 40, true);
            const correlations one(c), back(c);
            one.add(all, 0, 20);
            one.gap(0);
            const bytes_t file = one.file();
            TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_deserialise(back.self, file.data(), file.size()));
            one.add(all, 20, 20);
            back.add(all, 20, 20);
            TEST_ASSERT_TRUE(one.file() == back.file());
        }
}

void factors_are_not_changed_by_looks() {
    constexpr size_t count = 400, m = 3, lags = 9, n = m * (lags + 1);
    for (const int32_t batch : {1, 2, 32})
        for (int shape = 0; shape < 3; ++shape) {
            okid_square_root_config_t c = okid_square_root_defaults(1, 2, lags);
            c.batch = batch;
            if (shape > 0) c.block = 50;
            if (shape == 1) c.slots = 3;
            if (shape == 2) c.forgetting = 0.99;
            const samples all(OKID_SAMPLE_DOUBLE, m * count, false);
            const okid_test::factors each[2] = {okid_test::factors(c), okid_test::factors(c)};
            std::vector<okid_real_t> factor[2] = {std::vector<okid_real_t>(n * n), std::vector<okid_real_t>(n * n)};
            const double scale[m] = {2, 3, 4}, offset[m] = {1, 0, -1};
            for (const okid_test::factors& one : each) okid_square_root_set_units(one.self, scale, offset);
            for (size_t at = 0; at < count; at += 32) { // whole batches: a look ends one
                const size_t some = std::min<size_t>(32, count - at);
                for (const okid_test::factors& one : each)
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(one.self, all.numbers.data() + m * at, some));
                std::vector<double> gram(n * n);
                for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) {
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(each[1].self, detrend, gram.data(), nullptr));
                    TEST_ASSERT_EQUAL(OKID_OK,
                                      okid_square_root_factor(each[1].self, detrend, factor[1].data(), nullptr));
                }
            }
            for (int k = 0; k < 2; ++k)
                TEST_ASSERT_EQUAL(OKID_OK,
                                  okid_square_root_factor(each[k].self, OKID_DETREND_NONE, factor[k].data(), nullptr));
            for (size_t i = 0; i < n * n; ++i)
                TEST_ASSERT_DOUBLE_WITHIN(1e-12 * std::abs(factor[0][0]), factor[0][i], factor[1][i]);
        }
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(the_buffer_changes_no_bit);
    RUN_TEST(looks_change_no_bit);
    RUN_TEST(the_fft_changes_no_bit_of_codes_and_little_of_doubles);
    RUN_TEST(correlations_are_not_changed_by_looks_nor_codes_by_the_buffer);
    RUN_TEST(what_is_read_back_goes_on);
    RUN_TEST(factors_are_not_changed_by_looks);
    return UNITY_END();
}
