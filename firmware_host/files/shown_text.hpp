// SPDX-License-Identifier: MIT
// PURPOSE  words for a terminal, whatever names and remote texts stand in them
// METHOD   control characters, the letters that turn the direction of writing, and bytes that are no UTF-8 are written as
//          \x1b and \u202e; nothing in a file can move the cursor, set a title or hide the rest of a line
#pragma once
#include <string>
#include <string_view>

namespace okid_host {

/// New lines and tabs stay.
std::string shown(std::string_view text);

/// New lines are written as \n too: the name of a file makes no second message.
std::string one_line(std::string_view text);

} // namespace okid_host
