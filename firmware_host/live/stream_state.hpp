// SPDX-License-Identifier: MIT
// A saved stream: its head with rate, channels and a check sum over everything, and the samples of method auto behind it.
#pragma once
#include "stream_config.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

/// Samples or sums of the stream behind their head.
std::vector<std::byte> with_head(const stream_config& config, const std::vector<std::byte>& body);

struct state_body {
    const void* from;
    std::size_t bytes;
};
/// What stands behind the head. Sums of 0.1 have none. Throws `failure` (exit 2) for a state that is damaged, of another
/// rate, of other channels or of the other kind of method, and for samples without a head.
state_body behind_head(const stream_config& config, const void* state, std::size_t bytes);

/// Records one after another.
struct saved_samples {
    std::vector<std::int64_t> ends; ///< of its records
    std::vector<double> rows;
    std::vector<std::byte> older; ///< sums of the samples before them; empty: there are none
};
std::vector<std::byte> samples_body(std::size_t n_u, std::size_t n_y, const saved_samples& from);
/// Throws `failure` (exit 2) for bytes of another number of channels, and for what is damaged.
saved_samples read_samples(const std::string& where, std::size_t n_u, std::size_t n_y, const void* body,
                           std::size_t bytes);

} // namespace okid_host
