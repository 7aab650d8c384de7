// SPDX-License-Identifier: MIT
// The section [identification] of a CONFIG.toml.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

void read_identification(const toml::table& file, live_config& config);

/// Why the length of a window cannot be chosen by itself; "" when it can.
std::string chosen_window_fault(const identification_config& wanted);

/// Why a window cannot hold enough samples for a model; "" when it can.
std::string window_fault(const identification_config& wanted, std::size_t n_u, std::size_t n_y, double rate_hz);

} // namespace okid_host
