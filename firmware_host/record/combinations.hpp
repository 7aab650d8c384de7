// SPDX-License-Identifier: MIT
// Frequencies that are multiples, sums or differences of others: the mark of a structure that is not linear.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <vector>

namespace okid_host {

/// Takes modes that move in phase with a product of stronger vibrations out of the model (verdict `harmonic`) and remarks
/// `nonlinear`. Needs work.model of these modes and, with forces, its initial states.
/// @return whether a mode of the model was taken out
bool mark_combinations(std::vector<listed_mode>& modes, double fs_hz, record_work& work);

} // namespace okid_host
