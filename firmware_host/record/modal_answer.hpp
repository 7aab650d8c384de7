// SPDX-License-Identifier: MIT
// What a modal model says of a record: the motion of each mode under the measured forces, and what that leaves.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <complex>
#include <vector>

namespace okid_host {

/// One record run through the model: the states of its modes, and what is left of the outputs.
struct answered_record {
    std::vector<std::vector<std::complex<double>>> states; ///< modes, samples
    std::vector<double> left;                              ///< samples x n_y, NaN where a sample is missing
    std::size_t count = 0;
};

/// Record r under work.model, whose modes these are, from the states of work.context.x0; ends where a force is missing.
answered_record answer(const record_work& work, const std::vector<const listed_mode*>& modes, std::size_t r);

} // namespace okid_host
