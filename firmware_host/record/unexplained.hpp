// SPDX-License-Identifier: MIT
// Peaks of power that no mode of the answer explains are reported.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <vector>

namespace okid_host {

/// Adds the warning `unexplained` where the outputs, of records with a force what the model leaves of them, have a peak of power that no
/// listed mode is at, or only one that few runs found: its frequencies, the strongest first.
void remark_unexplained(const std::vector<listed_mode>& listed, double fs_hz, record_work& work);

} // namespace okid_host
