// SPDX-License-Identifier: MIT
// Outputs that the forces explain far less than the others: a sensor that failed, clips or is not linear.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <vector>

namespace okid_host {

/// What the simulation leaves of each output, of its amplitude; far more than of the middle one: it is noisy.
struct noisy_outputs {
    std::vector<double> left;
    std::vector<std::size_t> which;
    double middle = 0;
};
noisy_outputs noisy_outputs_of(const result_context& context);

/// Each noisy output: adds the remark noisy_output.
void remark_noisy_outputs(result_context& context);

/// Modes that a noisy output shows nearly alone are doubtful, unless there are no others.
/// @return is work.model another now? It is that of none of these modes
bool mark_of_noisy_outputs(std::vector<listed_mode>& modes, double fs_hz, record_work& work);

} // namespace okid_host
