// SPDX-License-Identifier: MIT
// By which clocks the nodes sample: the keys clock and rate_hz of [[bus]], decimate of [acquisition].
#pragma once
#include "config.hpp"
#include "toml_parser.hpp"

#include <cstddef>
#include <vector>

namespace okid_host {

/// Of a configuration whose buses and channels are known. Throws `failure` (exit 2).
void read_clocks(const toml::table& file, live_config& config);

/// The parts of a configuration whose samples come by one clock: first the reference. Channel numbers, in ascending order.
std::vector<std::vector<std::size_t>> clock_domains(const live_config& config);

} // namespace okid_host
