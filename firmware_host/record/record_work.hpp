// SPDX-License-Identifier: MIT
// PURPOSE  what the steps of a record identification hand on to each other
#pragma once
#include "consensus/level_memory.hpp"
#include "record.hpp"
#include "record_uncertainty.hpp"
#include "summed_inputs.hpp"
#include "uneven_blocks.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace okid_host {

/// The memory of a refined model.
struct refined_arrays {
    std::vector<double> A, B, C, D, K, markov, frequency, damping, mpc, emac, cmi, shape_re, shape_im;
    std::vector<double> innovation, mean;               ///< of a modal model
    std::vector<double> C_without_skew, D_without_skew; ///< where outputs come late

    /// The model looks into the modes that are here.
    void show_modes(okid_identified_t& model) const {
        model.frequency_hz = frequency.data();
        model.damping_ratio = damping.data();
        model.mpc = mpc.data();
        model.emac = emac.data();
        model.cmi = cmi.data();
        model.shape_re = shape_re.data();
        model.shape_im = shape_im.data();
    }
};

class older_samples;

/// Records, configuration and model. The model looks into `memory` (of `identifier`) or, refined, into `refined`.
struct record_work {
    record_set set;
    bool at_rest = false; ///< every record begins with silence
    okid_identify_config_t config{};
    okid_identified_t model{};
    result_context context;
    const record_set* struck = nullptr;    ///< auto: the records of which `set` is what follows the hits
    const older_samples* before = nullptr; ///< auto: what is known of the samples before those of `set`
    bool force_is_older = false;           ///< … and they have the force: B and D come from sums
    mode_inputs inputs;                    ///< then, of each listed mode; no residues: not known
    std::unique_ptr<std::byte[]> memory;
    okid_identify_t* identifier = nullptr;
    const level_memory* older = nullptr; ///< sums of samples before those of `set`
    bool analytic = false;               ///< deviations out of what it holds, see leave_out_blocks()
    okid_identified_t realised{};        ///< what it gave, before any refinement
    std::unique_ptr<refined_arrays> refined;
    std::vector<double> states;         ///< initial ones of the model where they are known; a method by name: of
                                        ///< fits that are left for later
    std::vector<mode_carrier> carriers; ///< auto: of each listed mode
    std::vector<double> scale;          ///< auto: of each channel
    std::vector<std::pair<double, double>> apart; ///< auto: of each listed mode, see consensus_mode
    std::vector<widening> wider;                  ///< auto: of each listed mode, see carried_mode
    std::vector<std::vector<mode_shift>> shifts;  ///< auto: of each listed mode, a block each; empty: not known
};

/// input_dofs and output_dofs, where they are said.
void describe_dofs(const record_options& options, result_context& to);

/// What is known of a result before anything is computed.
result_context describe_records(const record_set& set, const record_options& options, const missing_count& missing);

/// Take its own line out of each channel of each record; refuses a channel that is nothing else.
void detrend_linear(record_set& set, const record_options& options);

} // namespace okid_host
