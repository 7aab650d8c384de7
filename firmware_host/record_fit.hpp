// SPDX-License-Identifier: MIT
// How well a model reproduces the records it came from: initial states, simulation and one-step prediction.
#pragma once
#include "record.hpp"

namespace okid_host {

/// Fill x0, simulation_percent and prediction_percent of result.context. The records are in the model's own terms
/// (detrended); missing inputs are taken as 0. Without inputs: prediction_percent only.
void fit_records(const std::vector<record_data>& records, record_result& result);

} // namespace okid_host
