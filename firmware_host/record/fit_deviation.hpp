// SPDX-License-Identifier: MIT
// Standard deviations of modes that one event of the record tells of.
#pragma once
#include "modal_model.hpp"

namespace okid_host {

/// Of a record with a force: where one block in twenty holds more than a fifth of what is known of a mode (a hit), or a mode has
/// no deviation, its deviations become those of a least-squares fit. The others stay. work.model is that of the modes that are in it.
/// @param listed  modes of work.context.sigma, in its order
void deviations_by_fit(const std::vector<listed_mode>& listed, record_work& work);

/// Of one output under a force: a mode is doubtful (`wide_sigma`) whose deviation is as large as its damping, or 5 % of its frequency.
/// No shape says that it is one. @return whether there is one
bool doubt_wide(std::vector<listed_mode>& listed, record_work& work);

} // namespace okid_host
