// SPDX-License-Identifier: MIT
// The modes that are in frequency responses of one set-up or of several, with one frequency and damping for all of them.
#pragma once
#include "consensus/consensus.hpp"
#include "modal_fit.hpp"
#include "result/deviations.hpp"
#include "result/stabilization.hpp"

#include <optional>
#include <utility>

namespace okid_host {

/// Responses of one structure in several set-ups. What excited it may be another in each: shapes are scaled at the
/// references.
struct joint_responses {
    std::vector<response_set> sets;      ///< at the same lines
    std::vector<std::string> outputs;    ///< of all set-ups
    std::vector<std::string> references; ///< outputs that stand in every set-up
    double window_s = 0;                 ///< that averages of random vibration may have had; 0: none
    double sample_s = 0;                 ///< between the samples of the decays whose transforms they are; 0: none
};

/// Outputs that every set-up has.
std::vector<std::string> common_outputs(const std::vector<response_set>& sets);

/// Shape of the residues of a mode with the scatter of its entries, largest entry 1.
struct residue_shape {
    std::vector<std::complex<double>> shape;
    std::vector<double> scatter;
    double strength = 0;       ///< over the noise
    Eigen::MatrixXcd residues; ///< of the first set-up: outputs x inputs
    Eigen::MatrixXd variance;  ///< of a part of each
};

struct response_modes {
    std::vector<consensus_mode> modes; ///< ascending
    std::vector<residue_shape> shapes;
    deviations sigma;                    ///< of frequency and damping, by what the fit leaves and between places
    std::optional<stabilization> stable; ///< poles over the degrees of one fit of each set-up, where asked for
};

/// What many fits agree on, refined, judged. Throws (exit 3) where no mode is confident.
/// @param all  also what few fits found; @param numbers  of the modes picked by hand; @param diagram  .stable is wanted
response_modes find_response_modes(const joint_responses& from, bool all, const std::vector<int>& numbers,
                                   bool diagram);

struct refined_modes {
    std::vector<std::complex<double>> poles; ///< rad/s
    std::vector<residue_shape> shapes;
    std::vector<std::pair<double, double>> sigma; ///< of frequency and damping
};

/// Residues of given poles, and the poles after so many steps at most.
refined_modes fit_response_modes(const joint_responses& from, const std::vector<std::complex<double>>& poles,
                                 int steps);

std::complex<double> pole_of(const consensus_mode& mode);

/// What an exponential window added to the decay rate is taken away; `nothing_left`: the code of a mode without any other.
void take_window_out(double constant_s, const char* nothing_left, consensus_mode& mode);

} // namespace okid_host
