// SPDX-License-Identifier: MIT
// Numbers as text, ten digits, for tables of millions of them.
#pragma once
#include <string>

namespace okid_host {

/// The text of "{:.10g}", to the character.
void append_ten_digits(std::string& text, double value);

} // namespace okid_host
