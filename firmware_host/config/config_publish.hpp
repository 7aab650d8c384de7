// SPDX-License-Identifier: MIT
// [publish]: where events and modes go beside the events file and the terminal; [virtual]: channels that are computed.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill config.publish. Throws `failure` (exit 2); also for what this build of okid cannot do.
void read_publish(const toml::table& file, live_config& config);

/// Fill config.virtual_sensors, behind read_publish(). Throws `failure` (exit 2).
void read_virtual(const toml::table& file, live_config& config);

} // namespace okid_host
