// SPDX-License-Identifier: MIT
// Modes that are lines: hum, tones of machines, multiples of a strong vibration.
#pragma once
#include "consensus.hpp"
#include "levels.hpp"

namespace okid_host {

/// Adds "tone", "pickup" or "harmonic" to the modes that are no vibration of the structure by itself.
/// @param at_rest  the records are silent before their forces
void mark_lines(const std::vector<record_level>& levels, std::size_t n_u, std::size_t n_y, bool at_rest,
                std::vector<consensus_mode>& modes);

} // namespace okid_host
