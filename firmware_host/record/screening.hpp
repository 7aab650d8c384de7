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

/// What the channels of a stream usually do.
struct usual_values {
    std::vector<double> centre, spread; ///< of each output; spread 0: not known
    std::vector<double> pulse;          ///< of each force, beyond it a hit; infinite: it does not rest in between
};
usual_values usual_of(const record_set& set);

/// Samples about one that say whether it is a spike.
constexpr std::size_t about_a_spike = 64;

/// A row with its outputs that are spikes missing. @param rows  `count` of them, in which it stands at `at`
void without_spikes(const double* rows, std::size_t count, std::size_t at, const usual_values& usual, double* row);

/// Bad samples of the outputs become missing (NaN, nothing is interpolated). Forces are not looked at: a hammer's is silent and
/// spikes by nature.
screened_outputs screen_outputs(record_set& set, const std::vector<std::string>& outputs);

/// The records without the outputs that are not kept.
record_set without_outputs(const record_set& set, const std::vector<bool>& kept);

} // namespace okid_host
