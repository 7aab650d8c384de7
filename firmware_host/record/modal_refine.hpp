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
/// insists), and all modes keep their identity. Without an input: of free decays; where forces act in hits and are not known
/// between samples, of what follows the hits. @param decays  after_hits() of the records as measured. @return the modes have changed
bool refine_agreed(const record_options& options, const record_set& decays, std::vector<listed_mode>& listed,
                   record_work& work);

/// The same of these free decays, a part of the records of `work`.
bool refine_decays(const record_set& decays, const record_options& options, std::vector<listed_mode>& listed,
                   record_work& work);

} // namespace okid_host
