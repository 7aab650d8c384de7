// SPDX-License-Identifier: MIT
// What a file is that was given in the place of another.
#pragma once
#include <string>

namespace okid_host {

enum class file_kind { unknown, can_log, dbc, json, journal, toml, csv };

/// By how its text begins.
file_kind kind_of_text(const std::string& text);

/// "a log of CAN frames", "a DBC", … for messages.
const char* file_kind_name(file_kind kind);

} // namespace okid_host
