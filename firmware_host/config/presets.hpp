// SPDX-License-Identifier: MIT
// drivers/presets/*.toml, built into the program: keys that a [[bus]] or [[channel]] takes over with preset = "…".
#pragma once
#include "toml_parser.hpp"
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace okid_host {

/// Name and text of every preset file; written by CMake.
extern const std::vector<std::pair<std::string_view, std::string_view>> preset_files;

/// A line for each preset: its name, what it is for, its channels.
std::string list_presets();

/// Give every [[bus]] with preset = "NAME" and every [[channel]] with preset = "NAME.CHANNEL" the keys of the preset that
/// it does not have itself. Throws `failure` (exit 2) for a preset that does not exist.
/// @param texts  in: texts of presets that stand before the built-in ones; out: those that were used, by name
void apply_presets(const std::string& path, toml::table& file, std::map<std::string, std::string>& texts);

} // namespace okid_host
