// SPDX-License-Identifier: MIT
// Accumulators of all kinds read and write no array further than it reaches: their blocks, samples, results and files.
#include "accumulators.hpp"
#include "fenced.hpp"

#include <cmath>
#include <cstdint>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

enum { M = 3, LAGS = 3, COUNT = 300, WIDTH = M * (LAGS + 1) };

/// The same samples in each of the kinds that can be added.
struct samples {
    fenced<double> numbers;
    fenced<float> floats;
    fenced<int16_t> words;
    fenced<int32_t> longs;

    samples(fence where, size_t count)
        : numbers(where, count), floats(where, count), words(where, count), longs(where, count) {
        for (size_t i = 0; i < count; ++i) {
            const int x = static_cast<int>(i * i % 1009) - 500;
            numbers[i] = x;
            floats[i] = static_cast<float>(x);
            words[i] = static_cast<int16_t>(x);
            longs[i] = x;
        }
    }
};

const okid_sample_t kinds[] = {OKID_SAMPLE_DOUBLE, OKID_SAMPLE_INT16, OKID_SAMPLE_INT24, OKID_SAMPLE_INT32};

void accumulators() {
    on_both_sides([](fence where) {
        const samples all(where, M * COUNT);
        const fenced<double> scale(where, std::vector<double>{2, 3, 4}), offset(where, std::vector<double>{1, 0, -1});
        for (const okid_sample_t kind : kinds)
            for (int shape = 0; shape < 4; ++shape) {
                const okid_accumulator_config_t c = okid_test::shape_of(shape, kind, 40);
                const fenced<unsigned char> block(where, okid_accumulator_memsize(&c));
                okid_accumulator_t* self = nullptr;
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_create(&self, &c, block, block.size()));
                okid_accumulator_set_units(self, scale, offset);
                okid_status_t status = OKID_OK;
                if (kind == OKID_SAMPLE_DOUBLE)
                    status = okid_accumulator_add(self, all.numbers, COUNT);
                else if (kind == OKID_SAMPLE_INT16)
                    status = okid_accumulator_add_i16(self, all.words, COUNT);
                else
                    status = okid_accumulator_add_i32(self, all.longs, COUNT);
                TEST_ASSERT_EQUAL(OKID_OK, status);
                const fenced<double> gram(where, WIDTH * WIDTH), mean(where, M), energy(where, M), S(where, M * WIDTH),
                    head(where, M * LAGS), tail(where, M * LAGS), sum(where, M);
                for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) {
                    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_gram(self, detrend, gram, mean));
                    TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_energy(self, detrend, energy));
                    for (size_t r = 0; r < M; ++r)
                        TEST_ASSERT_DOUBLE_WITHIN(1e-10 * energy[r], energy[r], gram[r * (WIDTH + 1)]);
                    okid_run_sums_t run{S, head, tail, sum, mean, 0};
                    if (shape == 0 || shape == 2) TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_run(self, detrend, &run));
                }
                const fenced<unsigned char> file(where, okid_accumulator_serialised_size(self));
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_serialise(self, file, file.size()));
                okid_accumulator_config_t found;
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_peek(file, file.size(), &found));
                TEST_ASSERT_EQUAL(OKID_OK, okid_accumulator_deserialise(self, file, file.size()));
            }
    });
}

void correlations() {
    on_both_sides([](fence where) {
        const samples all(where, M * COUNT);
        for (const okid_sample_t kind : kinds)
            for (const int32_t block : {0, 40})
                for (const int32_t lags : {3, 40}) {
                    okid_correlation_config_t c = okid_correlation_defaults(1, M - 1, lags);
                    c.sample = kind;
                    c.own_lags = 2;
                    c.block = block;
                    c.slots = 3;
                    const fenced<unsigned char> room(where, okid_correlation_memsize(&c));
                    okid_correlation_t* self = nullptr;
                    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_create(&self, &c, room, room.size()));
                    okid_status_t status = OKID_OK;
                    if (kind == OKID_SAMPLE_DOUBLE)
                        status = okid_correlation_add(self, all.numbers, COUNT);
                    else if (kind == OKID_SAMPLE_INT16)
                        status = okid_correlation_add_i16(self, all.words, COUNT);
                    else
                        status = okid_correlation_add_i32(self, all.longs, COUNT);
                    TEST_ASSERT_EQUAL(OKID_OK, status);
                    const fenced<unsigned char> work(where, okid_correlation_sums_memsize(self));
                    okid_correlation_sums_t sums;
                    TEST_ASSERT_EQUAL(OKID_OK,
                                      okid_correlation_sums(self, OKID_DETREND_MEAN, &sums, work, work.size()));
                    const fenced<unsigned char> file(where, okid_correlation_serialised_size(self));
                    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_serialise(self, file, file.size()));
                    okid_correlation_config_t found;
                    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_peek(file, file.size(), &found));
                    TEST_ASSERT_EQUAL(OKID_OK, okid_correlation_deserialise(self, file, file.size()));
                }
    });
}

void factors() {
    on_both_sides([](fence where) {
        const samples all(where, M * COUNT);
        for (const int32_t batch : {1, 7, 32})
            for (int shape = 0; shape < 3; ++shape) {
                okid_square_root_config_t c = okid_square_root_defaults(1, M - 1, LAGS);
                c.batch = batch;
                if (shape > 0) c.block = 40;
                if (shape == 1) c.slots = 3;
                if (shape == 2) c.forgetting = 0.99;
                const fenced<unsigned char> block(where, okid_square_root_memsize(&c));
                okid_square_root_t* self = nullptr;
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_create(&self, &c, block, block.size()));
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add(self, all.numbers, COUNT));
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_f32(self, all.floats, COUNT));
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_i16(self, all.words, COUNT));
                TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_add_i32(self, all.longs, COUNT));
                const fenced<double> gram(where, WIDTH * WIDTH), mean(where, M);
                const fenced<okid_real_t> factor(where, WIDTH * WIDTH);
                for (const okid_detrend_t detrend : {OKID_DETREND_NONE, OKID_DETREND_MEAN}) {
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_gram(self, detrend, gram, mean));
                    TEST_ASSERT_EQUAL(OKID_OK, okid_square_root_factor(self, detrend, factor, mean));
                }
            }
    });
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(accumulators);
    RUN_TEST(correlations);
    RUN_TEST(factors);
    return UNITY_END();
}
