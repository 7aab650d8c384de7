// SPDX-License-Identifier: MIT
// Shapes over the places of a roving hammer, by reciprocity.
#pragma once
#include "modal_model.hpp"

#include <vector>

namespace okid_host {

/// work.context.placed, MPC of these shapes, and what drive points say of polarities. Where one place was struck and no
/// sensor can be added, the shapes stay those of the outputs.
/// @param modes  as listed; the records of `work` are those of one force about their means
void place_shapes(const std::vector<listed_mode>& modes, const record_options& options, record_work& work);

/// The plan of M, K and R: the one of `options` where there are modes enough for it, else one without forces, and `said` has why.
mass_plan matrices_of_places(const std::vector<listed_mode>& modes, const record_options& options, remarks& said);

} // namespace okid_host
