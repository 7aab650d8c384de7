// SPDX-License-Identifier: MIT
// PURPOSE  which columns of a record are probably forces and which responses, by their units, else by their names
#pragma once
#include <string>
#include <vector>

namespace okid_host {

/// "inputs" or "outputs", "" = the name of the column does not tell.
const char* proposed_side(const std::string& column);

/// The same as a message has it, in options of `okid identify`; "" without a response, and for more columns than a message
/// can name.
std::string proposed_options(const std::vector<std::string>& columns);

} // namespace okid_host
