// SPDX-License-Identifier: MIT
// PURPOSE  frequency responses from files: universal files (data sets 58 and 58b) and CSV
#pragma once
#include "response_set.hpp"

namespace okid_host {

/// By the extension .uff or .unv, else CSV: a column frequency_hz, then "OUT/IN:re" and "OUT/IN:im" (or :db, :mag with :deg; :coh) of each response.
/// A response that is not in the file is NaN throughout. Throws `failure` (exit 2).
response_set read_responses(const std::string& path);

/// All files as one structure: join_set_ups().
response_set read_set_ups(const std::vector<std::string>& paths);

} // namespace okid_host
