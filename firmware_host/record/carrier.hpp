// SPDX-License-Identifier: MIT
// One model that carries the modes of one rate: their standard deviations, and sharper values of nearly noise-free records.
#pragma once
#include "consensus/consensus_runs.hpp"
#include "record.hpp"
#include "record_uncertainty.hpp"
#include "uneven_blocks.hpp"

#include <optional>
#include <vector>

namespace okid_host {

/// What a carrier says of one mode.
struct carried_mode {
    double frequency_hz = 0, damping_ratio = 0, mpc = 0;
    double frequency_std_hz = NAN, damping_std = NAN;
    std::vector<std::complex<double>> shape;        ///< as the level has it, largest entry 1
    std::vector<double> shape_re_std, shape_im_std; ///< empty: not known
    std::vector<mode_shift> shifts;                 ///< a block each, empty: not known
    widening wider;                                 ///< of ambient vibration: what the deviations lack
    bool exact = false;                             ///< from the QR factor of nearly noise-free records
    mode_carrier by;
};

/// What a model and its replicates say of the modes wanted; none where the model lacks them.
std::vector<std::optional<carried_mode>> carried_by(const okid_identified_t& model,
                                                    const std::vector<replicate_model>& replicates,
                                                    const std::vector<mode_shift>& wanted);

/// The run of CVA with the longest horizon at a level; nullptr: none.
const consensus_run* long_run(const std::vector<consensus_run>& runs, int level);

/// Orders of this run, the best carrier of the modes wanted first: where its poles lie nearest to what the runs agree on, in
/// half-power bandwidths. At an order that cuts through a mode its pole is elsewhere, and a block less takes it out.
std::vector<int> carrying_orders(const consensus_run& run, const std::vector<mode_shift>& wanted);

/// The modes of `modes` that belong to this level, from one CVA model of the lowest order that has them all; none where the
/// model lacks them. @param blocks  left out in turn for the standard deviations, 0 = none
/// @param analytic  to first order
std::vector<std::optional<carried_mode>> carry(const record_level& level, int number,
                                               const std::vector<consensus_run>& runs,
                                               const std::vector<consensus_mode>& modes, int n_u, int n_y, bool at_rest,
                                               int blocks, bool analytic);

using listed_pair = std::pair<consensus_mode, std::optional<carried_mode>>;

/// Standard deviations and, of nearly noise-free records, sharper values, from one carrier for each rate.
std::vector<listed_pair> carry_all(const std::vector<record_level>& levels, const std::vector<consensus_run>& runs,
                                   const std::vector<consensus_mode>& modes, const record_options& options, bool rest);

} // namespace okid_host
