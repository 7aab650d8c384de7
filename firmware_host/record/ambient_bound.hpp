// SPDX-License-Identifier: MIT
// What no estimate from ambient vibration can be better than.
#pragma once
#include "modal_model.hpp"

#include <vector>

namespace okid_host {

/// Standard deviations of modes of records without a measured force, raised to what a steady random force leaves unknown:
/// f sqrt(zeta/(2 omega T)) and sqrt(zeta/(omega T)) over T seconds. Records whose power is not steady (decays), and modes
/// that ring down between hits, stay as they are.
void keep_to_ambient_bound(const record_set& set, double fs_hz, const std::vector<listed_mode>& modes,
                           deviations& sigma);

} // namespace okid_host
