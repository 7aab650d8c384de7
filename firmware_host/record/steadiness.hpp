// SPDX-License-Identifier: MIT
// Does a structure keep its frequencies over level and time? What moves with the level is nonlinear.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <vector>

namespace okid_host {

/// Remarks `level_dependent` and `time_varying`, with the modes and by how much, from the records and the model of these modes.
void remark_unsteady(const std::vector<listed_mode>& modes, double fs_hz, record_work& work);

} // namespace okid_host
