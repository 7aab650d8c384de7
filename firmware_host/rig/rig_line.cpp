// SPDX-License-Identifier: MIT
#include "rig_line.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <drv/stream.h>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double packet_s = 5e-3;

drv_stream_header_t header_of(const rig_run& run, std::size_t n, std::size_t count) {
    drv_stream_header_t header{};
    header.format = run.bits > 16 ? DRV_STREAM_INT24 : DRV_STREAM_INT16;
    header.channels = static_cast<std::uint8_t>(run.channels.size());
    header.samples = static_cast<std::uint8_t>(count);
    header.sequence = static_cast<std::uint32_t>(n);
    header.time_us = static_cast<std::uint32_t>(std::llround(static_cast<double>(n) / run.rate_hz * 1e6) & 0xFFFFFFFF);
    return header;
}

} // namespace

std::size_t rig_packet_samples(const rig_run& run) {
    const std::size_t bytes = run.bits > 16 ? 3 : 2, row = bytes * run.channels.size();
    const std::size_t room = (DRV_STREAM_MAX_BYTES - DRV_STREAM_OVERHEAD) / row;
    if (room == 0 || run.channels.size() > 252)
        throw failure(exit_usage,
                      fmt::format("{} channels of {} bytes do not fit a packet of {} bytes: play it on a CAN "
                                  "bus, or sense fewer dofs",
                                  run.channels.size(), bytes, int{DRV_STREAM_MAX_BYTES}));
    const auto wanted = static_cast<std::size_t>(std::llround(packet_s * run.rate_hz));
    return std::clamp<std::size_t>(wanted, 1, std::min<std::size_t>(room, 255));
}

std::vector<std::uint8_t> rig_packet(const rig_run& run, std::size_t n, std::size_t count) {
    const drv_stream_header_t header = header_of(run, n, count);
    std::vector<std::int32_t> codes;
    for (std::size_t i = 0; i < count; ++i)
        for (const rig_channel& channel : run.channels) codes.push_back(channel.codes[n + i]);
    std::vector<std::uint8_t> out(drv_stream_bytes(&header));
    out.resize(drv_stream_encode_codes(&header, codes.data(), out.data(), out.size()));
    return out;
}

double rig_line_rate(const rig_run& run) {
    const std::size_t samples = rig_packet_samples(run);
    const drv_stream_header_t header = header_of(run, 0, samples);
    return 10.0 * static_cast<double>(drv_stream_bytes(&header)) * run.rate_hz / static_cast<double>(samples);
}

} // namespace okid_host
