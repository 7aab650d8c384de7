// SPDX-License-Identifier: MIT
// What no estimate from ambient vibration can be better than.
#pragma once
#include "modal_model.hpp"
#include "uneven_blocks.hpp"

#include <vector>

namespace okid_host {

/// Standard deviations of modes of records without a measured force, raised to what a steady random force leaves unknown:
/// f sqrt(zeta/(2 omega T)) and sqrt(zeta/(omega T)) over T seconds, and where the power changes to what its blocks tell.
/// Modes that ring down between hits stay as they are; of unsteady records (decays) there is no bound. @param wider  of each
/// mode, empty: not known
void keep_to_ambient_bound(const record_set& set, double fs_hz, const std::vector<listed_mode>& modes,
                           const std::vector<widening>& wider, deviations& sigma);

} // namespace okid_host
