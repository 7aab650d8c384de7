// SPDX-License-Identifier: MIT
// PURPOSE    memory of okid_model_initial_state(), part of okid_model_workspace()
#pragma once
#include <okid/model.h>

#include <cstddef>

namespace okid {

/// Numbers of okid_real_t.
std::size_t initial_state_numbers(const okid_model_t& model);

} // namespace okid
