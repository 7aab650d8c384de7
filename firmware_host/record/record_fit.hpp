// SPDX-License-Identifier: MIT
// How well a model reproduces the records it came from: initial states, simulation and one-step prediction.
#pragma once
#include "record.hpp"

namespace okid_host {

/// A stretch of a record without missing inputs.
struct stretch {
    std::size_t first, count;
};

/// What a missing force did is not known: the record is cut there. Stretches of less than `least` samples, too short to
/// tell their initial state from the noise, are left out; a record without missing inputs is one stretch.
std::vector<stretch> stretches_of(const record_set& set, const record_data& record, std::size_t least);

/// B (n_z x n_u) and D (n_y x n_u) that make the simulated outputs of A and C fit the records best; x0, where given, gets
/// the initial state that goes with them, n_z numbers a record.
okid_status_t fit_outputs(const record_set& set, int n_z, const double* A, const double* C, std::vector<double>& B,
                          std::vector<double>& D, std::vector<double>* x0 = nullptr);

/// What the model's prediction leaves of each sample, n_y numbers, NaN where there is none to compare; from rest, or the
/// initial state that fits a stretch best. @param known  as of fit_records()
std::vector<double> residuals(const record_set& set, const okid_identified_t& model,
                              const std::vector<double>* known = nullptr);

/// Fill x0 of the context alone. @param known  as of fit_records()
void find_states(const record_set& set, const okid_identified_t& model, result_context& context,
                 const std::vector<double>* known);

/// Fill x0, simulation_percent and prediction_percent of the context. The records are in the model's own terms
/// (detrended); missing inputs are taken as 0. Without inputs: prediction_percent only.
/// @param known  initial states as fit_outputs() gives them, or none: serve the records without missing inputs
void fit_records(const record_set& set, const okid_identified_t& model, result_context& context,
                 const std::vector<double>* known = nullptr);

} // namespace okid_host
