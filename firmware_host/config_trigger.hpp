// SPDX-License-Identifier: MIT
// [trigger] and [lamps]: when identification begins, and the GPIO lines that tell how it stands.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill config.trigger and config.lamps. Throws `failure` (exit 2).
void read_trigger(const toml::table& file, live_config& config);

} // namespace okid_host
