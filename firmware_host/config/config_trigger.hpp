// SPDX-License-Identifier: MIT
// [trigger] and [lamps]: when identification begins, and the GPIO lines that tell how it stands.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// The channel that the key "channel" names, else the first force. Throws `failure` (exit 2).
std::size_t triggering_channel(const config_place& place, const toml::table& table, const live_config& config);

/// Fill config.trigger and config.lamps. Throws `failure` (exit 2).
void read_trigger(const toml::table& file, live_config& config);

} // namespace okid_host
