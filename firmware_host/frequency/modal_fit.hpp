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
    Eigen::VectorXd variance;                ///< of the noise of each response, of its real and imaginary part
    Eigen::VectorXd unit_variance;           ///< of the real part of a pole's residues for a noise of 1
    Eigen::VectorXd more_noise;              ///< than unit_variance has: near a pole, and as lines repeat each other
    double unlikeliness = 0;                 ///< mean logarithm of the variance of what is left
    std::vector<Eigen::Matrix2d> covariance; ///< of Re, Im of each pole; empty: not known
};

/// @param window_s  length of the Hann window that the responses were averaged under, 0: none; @param places  of each column, which place it was measured at, from 0; @param poles  the start, at least one. Fitted with
/// the residuals of modes below and above the band; poles that would run away stay where they were. @param steps  of the
/// poles, at most. @param sample_s  of sampled decays, the first halved, whose transforms the responses are; 0: they are not
modal_fit fit_modes(const response_set& set, const std::vector<Eigen::Index>& places,
                    std::vector<std::complex<double>> poles, int steps, double window_s, double sample_s);

} // namespace okid_host
