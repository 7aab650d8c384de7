// SPDX-License-Identifier: MIT
// Which keys a CONFIG.toml may hold, of which type and in which range; checked before anything is made of them.
#pragma once
#include "toml_parser.hpp"
#include <string>
#include <string_view>

namespace okid_host {

/// A table of the file with what a message about it needs.
struct config_place {
    const std::string& path;
    std::string section; ///< "[acquisition]", "[[channel]] \"force\""
};

/// "path: line 12, [[channel]] "a1", key "unit": <text>" with exit 2. `node`: what the key holds, for the line
/// number; nullptr: the key is not in the file, what is wrong follows from others.
[[noreturn]] void refuse_key(const config_place& place, const toml::node* node, std::string_view key,
                             const std::string& text);

/// Value of a node for a message: `"abc"`, `12`, `true`, `a table`.
std::string found_value(const toml::node& node);

/// Every section and key: known, of the right type, in range. Throws `failure` (exit 2).
void check_schema(const std::string& path, const toml::table& file);

/// "[[channel]] "a1"" or "[[channel]] number 3".
std::string entry_name(const char* section, const toml::table& entry, std::size_t index);

} // namespace okid_host
