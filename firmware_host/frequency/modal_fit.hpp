// SPDX-License-Identifier: MIT
// Residues of given poles in measured frequency responses (LSFD), and the poles that fit them best.
#pragma once
#include "response_set.hpp"

#include <complex>
#include <vector>

namespace okid_host {

struct modal_fit {
    std::vector<std::complex<double>> poles; ///< rad/s, upper half
    Eigen::MatrixXcd residues;               ///< a row a pole, columns as those of response_set::H
    Eigen::MatrixXcd left;                   ///< what the fit leaves, as response_set::H
    Eigen::VectorXd variance;                ///< of the noise of each response, of its real and imaginary part
    Eigen::MatrixXd unit_variance;           ///< of a residue's real part for a noise of 1, a row a pole
    Eigen::MatrixXd covariance;              ///< of Re, Im of each pole in turn; empty: not known
};

/// @param sensing  okid_sensing_t of each output; @param poles  the start, at least one. Fitted with the residuals of
/// modes below and above the band; poles that would run away stay where they were. @param steps  of the poles, at most
modal_fit fit_modes(const response_set& set, const std::vector<int>& sensing, std::vector<std::complex<double>> poles,
                    int steps);

} // namespace okid_host
