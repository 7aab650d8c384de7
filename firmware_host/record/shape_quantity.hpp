// SPDX-License-Identifier: MIT
// Shapes as the structure moves: of sensors that measure different quantities, or that come late.
#pragma once
#include "result/kept_model.hpp"
#include "result/result.hpp"

#include <vector>

namespace okid_host {

/// Divide each entry of a shape by lambda (velocity) or lambda^2 (acceleration) where `sensing` (okid_sensing_t of each output) has
/// more than one kind: shapes, their deviations, MPC and CMI. C and D stay in what the sensors measure.
void shapes_in_one_quantity(const std::vector<int>& sensing, kept_model& model, result_context& context);

/// Turn back the entries of outputs that are late (late_outputs.hpp), and remark `late_output`. Not of shapes over places that were
/// struck, nor beside `mixed_quantities`. C and D stay as recorded.
void shapes_without_delays(kept_model& model, result_context& context);

} // namespace okid_host
