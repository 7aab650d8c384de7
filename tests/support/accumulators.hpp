// SPDX-License-Identifier: MIT
// Accumulators of all three kinds, each in a block of its own, and the bytes of their files.
#ifndef OKID_TEST_ACCUMULATORS_HPP
#define OKID_TEST_ACCUMULATORS_HPP

#include <okid/accumulator.h>
#include <okid/correlation.h>
#include <okid/steps/square_root.h>

extern "C" {
#include <unity.h>
}
#include <cstdint>
#include <vector>

namespace okid_test {

using bytes_t = std::vector<unsigned char>;

/// The object and its configuration. A kind without files has neither size nor serialise.
template <class Object, class Config, auto memsize, auto create, auto mark_gap, auto count,
          auto serialised_size = nullptr, auto serialise = nullptr>
struct in_a_block {
    Config config;
    bytes_t block;
    Object* self = nullptr;

    explicit in_a_block(const Config& c) : config(c), block(memsize(&c)) {
        TEST_ASSERT_EQUAL(OKID_OK, create(&self, &c, block.data(), block.size()));
    }
    in_a_block(const in_a_block&) = delete;
    in_a_block& operator=(const in_a_block&) = delete;

    void gap(std::int64_t samples) const { mark_gap(self, samples); }
    okid_accumulator_stats_t stats() const {
        okid_accumulator_stats_t out;
        count(self, &out);
        return out;
    }
    bytes_t file() const {
        bytes_t out(serialised_size(self));
        TEST_ASSERT_EQUAL(OKID_OK, serialise(self, out.data(), out.size()));
        return out;
    }
};

using sums = in_a_block<okid_accumulator_t, okid_accumulator_config_t, okid_accumulator_memsize,
                        okid_accumulator_create, okid_accumulator_gap, okid_accumulator_stats,
                        okid_accumulator_serialised_size, okid_accumulator_serialise>;
using correlations = in_a_block<okid_correlation_t, okid_correlation_config_t, okid_correlation_memsize,
                                okid_correlation_create, okid_correlation_gap, okid_correlation_stats,
                                okid_correlation_serialised_size, okid_correlation_serialise>;
using factors = in_a_block<okid_square_root_t, okid_square_root_config_t, okid_square_root_memsize,
                           okid_square_root_create, okid_square_root_gap, okid_square_root_stats>;

/// One input, two outputs, three lags. Shapes 0 .. 3: growing; in blocks of so many rows; a window; memory that fades.
inline okid_accumulator_config_t shape_of(int shape, okid_sample_t kind, int32_t block) {
    okid_accumulator_config_t c = okid_accumulator_defaults(1, 2, 3);
    c.sample = kind;
    c.edges = shape == 2 ? 0 : 1;
    if (shape > 0) c.block = block;
    if (shape == 2) c.slots = 3;
    if (shape == 3) c.forgetting = 0.99;
    return c;
}

} // namespace okid_test

#endif
