// SPDX-License-Identifier: MIT
// PURPOSE  what the forces of records did between samples
#pragma once
#include "record.hpp"

namespace okid_host {

/// Does the spectrum of the forces fall towards Nyquist, as behind an anti-alias filter?
bool falls_to_nyquist(const record_set& set);

/// "zoh", "foh" or "band", of the records a model was identified from; the plan says what the outputs measure.
std::string hold_of_data(const record_set& set, const okid_identified_t& model, const mass_plan& plan);

} // namespace okid_host
