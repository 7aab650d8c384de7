// SPDX-License-Identifier: MIT
// [hammer]: the assistant of a hammer test.
#pragma once
#include "config.hpp"
#include "toml_parser.hpp"

namespace okid_host {

/// Fill config.hammer; the section's presence asks for it. Throws `failure` (exit 2).
void read_hammer(const toml::table& file, live_config& config);

} // namespace okid_host
