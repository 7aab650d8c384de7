// SPDX-License-Identifier: MIT
// M, K and R of method auto, with their standard deviations.
#pragma once
#include "modal_model.hpp"

#include <vector>

namespace okid_host {

/// Hold, mass, stiffness and damping matrices of the model in `work`, with what is to be said of them.
void find_matrices_agreed(const record_options& options, record_work& work);

/// Standard deviations of M, K, R: modes, B and D without one block of the records each.
void find_matrix_deviations(const std::vector<listed_mode>& listed, const record_options& options, record_work& work);

} // namespace okid_host
