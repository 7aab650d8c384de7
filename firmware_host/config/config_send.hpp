// SPDX-License-Identifier: MIT
// What a [[bus]] lets okid send: start frames and SYNC.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Fill sync_hz, sync_frame and start_frames of `bus`. Throws `failure` (exit 2).
void read_sending(const config_place& place, const toml::table& table, bus_config& bus);

} // namespace okid_host
