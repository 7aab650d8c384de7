// SPDX-License-Identifier: MIT
// Outputs looked at before anything is identified: clipped, frozen, dropped to zero, spikes.
#pragma once
#include "record.hpp"

#include <string>
#include <vector>

namespace okid_host {

struct screened_outputs {
    std::vector<bool> kept; ///< an output that is bad too often is left out as a whole
    remarks said;           ///< one `screened` for each output and kind of fault, with place and count
};

/// Bad samples of the outputs become missing (NaN, nothing is interpolated). Forces are not looked at: a hammer's is silent and
/// spikes by nature.
screened_outputs screen_outputs(record_set& set, const std::vector<std::string>& outputs);

/// The records without the outputs that are not kept.
record_set without_outputs(const record_set& set, const std::vector<bool>& kept);

} // namespace okid_host
