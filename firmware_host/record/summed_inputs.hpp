// SPDX-License-Identifier: MIT
// What the forces do to the modes, from sums: where they act in samples that are no longer kept.
#pragma once
#include "consensus/consensus_runs.hpp"
#include "result/deviations.hpp"

#include <Eigen/Dense>
#include <vector>

namespace okid_host {

/// Residues of modes, and the direct feed-through.
struct mode_inputs {
    std::vector<Eigen::MatrixXcd>
        residues;      ///< of the pole above the real axis (n_y x n_u), in the units of the channels
    Eigen::MatrixXd D; ///< n_y x n_u
};

/// Have the samples that are kept less than a twentieth of a force's energy? One without older samples has all of it.
bool force_is_older(const record_level& level, int n_u, int n_y, bool at_rest);

/// Of the confident modes, from one CVA model of the sums of the first level. Cost of one identification.
/// @return no residues where that model lacks one of the modes
mode_inputs summed_inputs(const record_level& level, const std::vector<consensus_run>& runs,
                          const std::vector<mode_shift>& wanted, int n_u, int n_y, bool at_rest);

} // namespace okid_host
