// SPDX-License-Identifier: MIT
// Shapes of records whose sensors measure different quantities, in one: displacement.
#pragma once
#include "result/kept_model.hpp"
#include "result/result.hpp"

#include <vector>

namespace okid_host {

/// Divide each entry of a shape by lambda (velocity) or lambda^2 (acceleration) where `sensing` (okid_sensing_t of each output) has
/// more than one kind: shapes, their deviations, MPC and CMI. C and D stay in what the sensors measure.
void shapes_in_one_quantity(const std::vector<int>& sensing, kept_model& model, result_context& context);

} // namespace okid_host
