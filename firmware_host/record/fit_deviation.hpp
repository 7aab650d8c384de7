// SPDX-License-Identifier: MIT
// Standard deviations of modes that one event of the record tells of.
#pragma once
#include "modal_model.hpp"

namespace okid_host {

/// Of a record with a force: where one block in twenty holds more than a fifth of what is known of a mode (a hit), or a mode has
/// no deviation, its deviations become those of a least-squares fit. The others stay. work.model is that of the modes that are in it.
/// @param listed  modes of work.context.sigma, in its order
void deviations_by_fit(const std::vector<listed_mode>& listed, record_work& work);

} // namespace okid_host
