// SPDX-License-Identifier: MIT
// The keys of a CONFIG.toml that belong to serial lines: [[bus]] of type serial and slcan, [[channel]] with a field.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// What stands in a log for a bus without an interface of its own.
std::string name_in_logs(const std::string& name);

/// Device, baud, framing, counter and registers of `bus`; refuses them on a bus of another type.
void read_line(const config_place& place, const toml::table& table, bus_config& bus);

/// Frame, layout, sequence and unit of a channel of a serial bus.
void resolve_field(const config_place& place, const toml::table& table, const bus_config& bus, channel_config& channel);

std::vector<std::string> framing_names();

} // namespace okid_host
