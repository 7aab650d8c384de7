// SPDX-License-Identifier: MIT
// PURPOSE  sentences that name options of the program, in the words of a caller who gives arguments
#pragma once
#include <string>

namespace okid_host::face {

/// "lower --p or use --hold foh" -> "lower p or use hold=foh": options of `okid identify` become arguments.
std::string argument_words(const std::string& text);

} // namespace okid_host::face
