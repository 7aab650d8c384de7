// SPDX-License-Identifier: MIT
// [record]: where raw frames are kept, and how many.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill config.record. Throws `failure` (exit 2). The channels and the trigger are there already.
void read_record(const toml::table& file, live_config& config);

} // namespace okid_host
