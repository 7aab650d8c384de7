// SPDX-License-Identifier: MIT
// drivers/presets/*.toml, built into the program: keys that a [[bus]] or [[channel]] takes over with preset = "…".
#pragma once
#include <string>
#include <string_view>
#include <toml++/toml.h>
#include <utility>
#include <vector>

namespace okid_host {

/// Name and text of every preset file; written by CMake.
extern const std::vector<std::pair<std::string_view, std::string_view>> preset_files;

/// Give every [[bus]] with preset = "NAME" and every [[channel]] with preset = "NAME.CHANNEL" the keys of the preset that
/// it does not have itself. Throws `failure` (exit 2) for a preset that does not exist.
void apply_presets(const std::string& path, toml::table& file);

} // namespace okid_host
