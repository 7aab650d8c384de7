// SPDX-License-Identifier: MIT
// Records without a force that are no repeats: the same names of outputs at other places.
#pragma once
#include "modal_model.hpp"
#include "record_set.hpp"
#include "result/deviations.hpp"

#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// Which record moves otherwise than the first at the modes that a record shows nearly alone, in words; "": none does. One of
/// them is enough to see it. Cost: a block transform of every output for each mode of the model.
/// @param sigma  of the modes, where known
std::string moved_outputs_text(const std::vector<listed_mode>& modes, const std::optional<deviations>& sigma,
                               double fs_hz, const record_set& set);

} // namespace okid_host
