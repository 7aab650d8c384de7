// SPDX-License-Identifier: MIT
// By which clocks the nodes sample: the keys clock and rate_hz of [[bus]], decimate of [acquisition].
#pragma once
#include "config.hpp"
#include "toml_parser.hpp"

namespace okid_host {

/// Of a configuration whose buses and channels are known. Throws `failure` (exit 2).
void read_clocks(const toml::table& file, live_config& config);

} // namespace okid_host
