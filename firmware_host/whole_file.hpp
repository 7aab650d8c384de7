// SPDX-License-Identifier: MIT
// Before the work: can the result be written where it is wanted? (write_whole_file() stands in result.hpp.)
#pragma once
#include <string>

namespace okid_host {

/// Throws `failure` (exit 2) when `path` is a folder or its folder is missing or not writable.
void check_writable(const std::string& path);

/// For a signal handler: remove the temporary of a write in progress. Async-signal-safe.
void remove_unfinished_file();

} // namespace okid_host
