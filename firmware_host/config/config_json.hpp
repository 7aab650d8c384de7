// SPDX-License-Identifier: MIT
// A checked CONFIG.toml as JSON, for `okid check --json` and for other languages.
#pragma once
#include "config.hpp"

#include <nlohmann/json.hpp>

namespace okid_host {

/// okid.check/1: every section with its defaults filled in, names looked up in the DBC, presets applied. Passwords stay out.
nlohmann::ordered_json config_json(const live_config& config);

} // namespace okid_host
