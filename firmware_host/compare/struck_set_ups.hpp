// SPDX-License-Identifier: MIT
// Set-ups of sensors that were moved, while one hammer struck at one place.
#pragma once
#include "frequency/identify_lags.hpp"

#include <vector>

namespace okid_host {

/// Has every set-up hits of one force, seen by sensors of one kind at two places or more?
bool are_struck(const std::vector<set_up>& set_ups, const record_options& options);

/// Shapes over the outputs of all, from all hits together. Throws `failure`. @param options  of identify_set_ups()
record_result identify_struck(std::vector<set_up> set_ups, const record_options& options);

} // namespace okid_host
