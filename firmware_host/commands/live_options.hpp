// SPDX-License-Identifier: MIT
// Options that run and replay have in common.
#pragma once
#include "live/session.hpp"

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

namespace okid_host {

struct live_arguments {
    std::string config, events, json, duration, speed;
    bool quiet = false;
};

void add_output_options(CLI::App& command, live_arguments& given);

/// A number of seconds above 0; throws `failure` (exit 2).
std::optional<double> parse_seconds(const char* option, const std::string& text);
/// Seconds as they stand in a log, to nanoseconds at microseconds; throws `failure` (exit 2).
std::optional<std::int64_t> parse_stamp(const char* option, const std::string& text);
/// "max" or a factor above 0; nothing = as fast as possible.
std::optional<double> parse_speed(const std::string& text);

/// Does the config play a log instead of devices? Throws `failure` (exit 2) when it does both, or lacks a trigger's time.
bool plays_a_log(const live_config& config);

/// Everything checked before any device is opened; the remarks of the config go to stderr. @param log  that is read, or ""
session_options check_live(const live_arguments& given, const live_config& config, const std::string& log);

} // namespace okid_host
