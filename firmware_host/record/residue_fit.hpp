// SPDX-License-Identifier: MIT
// B and D of given modes, of each record alone or of several together, and how much of a record they leave.
#pragma once
#include "modal_model.hpp"

#include <Eigen/Dense>
#include <vector>

namespace okid_host {

/// What one record says of B and D: residual(x) = y'y - 2 h'x + x'N x, the initial state eliminated.
struct residue_sums {
    Eigen::MatrixXd N;
    Eigen::VectorXd h;
    double left = 0;   ///< y'y less what the initial state explains
    double energy = 0; ///< y'y, each output in units of its spread over all records
    double samples = 0;
};

/// Of every record. @param at_rest  their initial states are zero
/// @param beside  samples of the forces before and after an output's that it may follow at once, beside its own: modes above the
///                band, that are not in the model, answer as a force and its derivatives do
std::vector<residue_sums> sum_residues(const std::vector<listed_mode>& modes, double fs_hz, const record_set& set,
                                       bool at_rest, int beside = 0);

/// The x that fits these records together: of each input the modes' coefficients (real, imaginary), then D, outputs first.
Eigen::VectorXd fit_residues(const std::vector<const residue_sums*>& records);

/// Keep as many of the samples `beside` in the sums of records that are fitted together as explain more than chance would
/// (Schwarz 1978).
void keep_samples_beside(std::vector<residue_sums>& records, int beside, std::size_t n_y);

/// What x leaves of a record, over its energy.
double residue_left(const residue_sums& record, const Eigen::VectorXd& x);

} // namespace okid_host
