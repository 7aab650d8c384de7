// SPDX-License-Identifier: MIT
// The modal table of a result that exists, as `okid identify` printed it when it was identified.
#pragma once
#include <string>

namespace okid_host {

/// @param text  of schema okid.result/1; @param name  of its file, for messages. Throws `failure` (exit 2).
std::string known_table(const std::string& text, const std::string& name);

} // namespace okid_host
