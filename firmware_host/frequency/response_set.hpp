// SPDX-License-Identifier: MIT
// PURPOSE  measured frequency responses in memory: of a file, of several set-ups of one structure, or of a caller
#pragma once
#include <Eigen/Dense>
#include <string>
#include <vector>

namespace okid_host {

struct response_set {
    std::vector<double> frequency_hz; ///< ascending, above 0
    std::vector<std::string> inputs, outputs;
    Eigen::MatrixXcd H; ///< lines x (outputs x inputs): output o of input i is column o + n_y i
    int set_ups = 1;
    std::string quantity; ///< of the outputs, as the file says: displacement, velocity, acceleration; "": it does not
    std::vector<std::string> other_units; ///< that numbers came in, "g = 9.80665 m/s^2": they are in SI units here

    Eigen::Index lines() const { return H.rows(); }
    Eigen::Index n_y() const { return static_cast<Eigen::Index>(outputs.size()); }
    Eigen::Index n_u() const { return static_cast<Eigen::Index>(inputs.size()); }
};

/// The place of a name; behind the last when it is not there.
Eigen::Index place_in(const std::vector<std::string>& names, const std::string& name);

/// The same, and a new name then stands there.
Eigen::Index place_of(std::vector<std::string>& names, const std::string& name);

/// Set-ups of one structure as one: every output of every input once, entries measured several times averaged. Throws
/// `failure` (exit 2) where the lines differ or an output was not measured for an input. `names`: of the set-ups.
response_set join_set_ups(const std::vector<response_set>& sets, const std::vector<std::string>& names);

/// The lines from low to high, without those at 0 Hz or with a response that is no number. Throws (exit 2) where fewer than
/// 32 stay.
response_set cut_band(const response_set& from, double low_hz, double high_hz);

/// Lines at which the responses are more than noise: those of neighbouring lines do not follow from each other where a force
/// has no power or a sensor is below its range. Throws (exit 3) where fewer than 32 stay.
response_set without_noise_lines(const response_set& from);

/// Of each output, the share of noise in the power of its middle line, by how little neighbouring lines follow from each
/// other: 1 of an output that measures nothing.
Eigen::VectorXd noise_shares(const response_set& from);

/// Outputs and inputs exchanged (Maxwell's reciprocity): what a roving hammer measures, as roving sensors would.
response_set exchanged(const response_set& from);

} // namespace okid_host
