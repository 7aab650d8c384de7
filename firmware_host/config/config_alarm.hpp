// SPDX-License-Identifier: MIT
// [alarm]: when a tracked mode has left its baseline, and what is run then.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill config.alarm; [identification] and [lamps] must have been read. Throws `failure` (exit 2).
void read_alarm(const toml::table& file, live_config& config);

/// Is it a program that this user may run?
bool may_execute(const std::string& path);

} // namespace okid_host
