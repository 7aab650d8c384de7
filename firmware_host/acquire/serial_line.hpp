// SPDX-License-Identifier: MIT
// Serial devices of this machine, and the settings of a bus on one of them.
#pragma once
#include "config/config.hpp"

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

/// What a driver needs; points into `bus`.
drv_line_config_t line_settings(const bus_config& bus, double rate_hz);

/// What the line itself counted, for a stats event.
nlohmann::ordered_json line_json(const drv_stats_t& counts);

/// /dev/serial/by-id/… where there are any, else /dev/ttyUSB*, /dev/ttyACM* and their like.
std::vector<std::string> serial_devices();

/// Does it name a serial device, by a path or by a link to one in this folder, rather than a CAN interface?
bool is_device(const std::string& target);

/// What to do about a device that cannot be opened. @param code  a positive errno
std::string line_remedy(int code, const std::string& device);

/// What opening the device of a bus for a moment shows; `remedy` is empty when all is well.
struct line_finding {
    std::string found, remedy, note;
};
line_finding look_at_line(const bus_config& bus);

/// The text and exit code for a device that cannot be opened.
[[noreturn]] void throw_line_failure(int code, const std::string& device, const std::string& reason);

} // namespace okid_host
