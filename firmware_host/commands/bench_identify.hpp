// SPDX-License-Identifier: MIT
// Whole identifications for okid bench: from samples in memory to A, B, C, D, K and modes, beside SLICOT.
#pragma once
#include <nlohmann/json.hpp>

namespace okid_host {

/// Rows "identify" (one size, noise level and method each) and their ratios of okid.bench/1.
void bench_identifications(nlohmann::ordered_json& rows, nlohmann::ordered_json& ratios);

/// The rows "identify" as tables: time beside accuracy.
void print_identifications(const nlohmann::ordered_json& rows);

} // namespace okid_host
