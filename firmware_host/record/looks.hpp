// SPDX-License-Identifier: MIT
// What different parts of the same records show: which part knows more.
#pragma once
#include "modal_model.hpp"
#include "record_work.hpp"

#include <exception>
#include <string>
#include <vector>

namespace okid_host {

/// What one set of records shows.
struct one_look {
    record_work work;
    std::vector<listed_mode> listed; ///< empty: `fault`
    std::exception_ptr fault;

    /// Modes in the model whose damping is known to a half.
    std::size_t believed() const;
};

/// How a part of the records knows the modes that the whole has, too: deviations over those of the whole (geometric mean of
/// frequency and damping); 1 where it has fewer than `judgement::shared_modes` of them. Compares all modes with all.
/// @param alone  becomes the frequencies of the modes of the whole that the part does not have, with unit
double deviations_over(const one_look& part, const one_look& whole, std::vector<std::string>& alone);

/// Power that the likeliest simulation of records by these modes leaves of the outputs, over all of theirs (mean over the outputs);
/// NaN without an input. B, D and initial states are fitted to these records: one output-error fit.
double power_left(const std::vector<listed_mode>& listed, record_set set, const record_options& options);

} // namespace okid_host
