// SPDX-License-Identifier: MIT
// Maximum likelihood of the modes that several methods agree on.
#pragma once
#include "modal_model.hpp"
#include "record.hpp"

#include <vector>

namespace okid_host {

/// Are records without an input, less their means, free decays of these modes, and what else they hold nearly white noise?
bool decay_freely(const std::vector<listed_mode>& modes, record_set set, const record_options& options);

/// Maximum likelihood of the modes in the model, where it applies: the residuals are nearly white (or the caller
/// insists), and all modes keep their identity. Without an input: of free decays. @return the modes have changed
bool refine_agreed(const record_options& options, std::vector<listed_mode>& listed, record_work& work);

} // namespace okid_host
