// SPDX-License-Identifier: MIT
// The rig as a node on a serial line: the project's own packets (docs/wire-protocol.md).
#pragma once
#include "rig_run.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

inline constexpr int rig_line_baud = 921600;

/// Samples that share a packet: some milliseconds' worth, as many as fit.
std::size_t rig_packet_samples(const rig_run& run);

/// Packet of samples n … n + count - 1, its closing 0 included.
std::vector<std::uint8_t> rig_packet(const rig_run& run, std::size_t n, std::size_t count);

/// Bits a second on the wire, start and stop bits included.
double rig_line_rate(const rig_run& run);

} // namespace okid_host
