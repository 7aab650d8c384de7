// SPDX-License-Identifier: MIT
// The known name closest to a mistyped one, and a quoted list of names, for messages.
#pragma once
#include <string>
#include <vector>

namespace okid_host {

/// ASCII letters in lower case.
std::string lower_case(std::string text);

/// The candidate with the smallest edit distance (letter case ignored), "" when none is near enough to be meant.
std::string nearest_name(const std::string& name, const std::vector<std::string>& candidates);

/// ` (did you mean "x"?)` or "".
std::string did_you_mean(const std::string& name, const std::vector<std::string>& candidates);

/// Names with commas between them, cut after `most`.
std::string list_names(const std::vector<std::string>& names, std::size_t most = 64);

/// Text of a file made fit for one line of a message: control bytes replaced, cut after `most` bytes.
std::string printable(const std::string& text, std::size_t most = 40);

/// The last part of a path, for a result that must not hold the folders of a machine.
std::string file_name(const std::string& path);

} // namespace okid_host
