// SPDX-License-Identifier: MIT
// [realtime]: what the threads that serve devices and disk may claim of the computer.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill config.realtime. Throws `failure` (exit 2).
void read_realtime(const toml::table& file, live_config& config);

} // namespace okid_host
