// SPDX-License-Identifier: MIT
// Frames for tests of the grid and of what stands before it: their layouts, lanes whose numbers are known, and the rows
// that come out.
#pragma once
#include "align/grid.hpp"

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

constexpr std::int64_t day_ns = INT64_C(1700000000000000000);

inline drv_signal_t bits_at(unsigned start, unsigned length, bool is_signed = false, bool big_endian = false) {
    drv_signal_t out{};
    out.start_bit = static_cast<std::uint16_t>(start);
    out.length = static_cast<std::uint16_t>(length);
    out.is_signed = is_signed;
    out.big_endian = big_endian;
    out.scale = 1;
    drv_signal_prepare(&out);
    return out;
}

inline channel_config channel_at(std::uint32_t id, const drv_signal_t& layout,
                                 const std::optional<drv_signal_t>& counter = {}) {
    channel_config out;
    out.frame.id = id;
    out.layout = layout;
    out.sequence = counter;
    return out;
}

/// Lane i of identifier 0x100 + i on bus i % buses: a counter of so many bits (0 = none), a number from byte 4 on.
inline live_config lanes_of(std::size_t lanes, unsigned counter_bits, double rate_hz = 1000, std::size_t buses = 1) {
    live_config out;
    out.rate_hz = rate_hz;
    out.buses.resize(buses);
    for (std::size_t i = 0; i < lanes; ++i) {
        channel_config channel = channel_at(static_cast<std::uint32_t>(0x100 + i), bits_at(32, 32));
        channel.name = "c" + std::to_string(i);
        channel.bus = i % buses;
        if (counter_bits > 0) channel.sequence = bits_at(0, counter_bits);
        out.channels.push_back(channel);
    }
    return out;
}

/// A frame of one of these lanes, `after_ns` behind day_ns. Of the counter, if there is one, the low bits are sent.
inline drv_frame_t lane_frame(const live_config& config, std::size_t lane, std::int64_t counter, std::int64_t number,
                              std::int64_t after_ns) {
    const channel_config& channel = config.channels[lane];
    drv_frame_t out{};
    out.id = channel.frame.id;
    out.bus = static_cast<std::uint8_t>(channel.bus);
    out.len = 8;
    out.time_ns = day_ns + after_ns;
    if (channel.sequence) drv_signal_put(&*channel.sequence, out.data, 8, counter);
    drv_signal_put(&channel.layout, out.data, 8, number);
    return out;
}

/// All rows as they come out, and the gaps.
struct row_recorder : grid_sink {
    std::size_t width = 0;
    std::vector<std::vector<double>> rows;
    std::vector<grid_gap> gaps;

    explicit row_recorder(std::size_t channels) : width(channels) {}
    void on_sample(std::int64_t, const double* row) override { rows.emplace_back(row, row + width); }
    void on_missing(std::int64_t, std::int64_t count) override {
        rows.insert(rows.end(), static_cast<std::size_t>(count), std::vector<double>(width, NAN));
    }
    void on_gap(const grid_gap& gap) override { gaps.push_back(gap); }
    std::int64_t marked() const {
        std::int64_t sum = 0;
        for (const grid_gap& gap : gaps) sum += gap.count;
        return sum;
    }
};

} // namespace okid_host
