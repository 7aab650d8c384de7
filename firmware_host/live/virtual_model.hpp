// SPDX-License-Identifier: MIT
// The model behind virtual sensors, and its file.
#pragma once
#include <Eigen/Dense>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

/// x+ = A x + B u + K e, y = C x + D u + e, e of covariance `noise`; what a file of schema okid.virtual/1 holds.
struct virtual_model {
    std::vector<std::string> inputs, outputs; ///< names
    double dt = 0;                            ///< s
    Eigen::MatrixXd A, B, C, D, K, noise;
    Eigen::VectorXd mean;      ///< of [u; y], taken off what comes and put back
    Eigen::VectorXd input_std; ///< stands for a measured input where it is missing; empty: not known
    Eigen::VectorXd widen;     ///< of the standard deviations of the outputs, >= 1
    Eigen::VectorXd force_std; ///< not empty: no input is measured, all are random forces of these standard deviations
    double force_hz = 0;       ///< above which their spectrum falls off; 0: white

    bool estimates_forces() const { return force_std.size() > 0; }
    /// Inputs that are measured.
    Eigen::Index n_u() const { return estimates_forces() ? 0 : B.cols(); }
    Eigen::Index n_y() const { return C.rows(); }
};

/// Both throw `failure` (exit 2) with the key, what was found and what was expected.
virtual_model virtual_model_of(const nlohmann::json& from);
nlohmann::ordered_json virtual_model_json(const virtual_model& model);

} // namespace okid_host
