// SPDX-License-Identifier: MIT
// The stabilization diagram of frequency responses.
#pragma once
#include "response_modes.hpp"

namespace okid_host {

/// Poles over the degrees of one fit of each set-up. @param runs  as many of each set-up, one set-up after the other
stabilization diagram_of(const joint_responses& from, const std::vector<consensus_run>& runs);

} // namespace okid_host
