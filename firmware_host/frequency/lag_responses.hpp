// SPDX-License-Identifier: MIT
// Frequency responses, or half-spectra, from correlation sums of records: the lag window is known and goes out of the poles.
#pragma once
#include "record/record_set.hpp"
#include "response_set.hpp"

#include <cmath>

namespace okid_host {

/// Sums over time of products of every channel with the references up to so many samples before.
struct lag_sums {
    std::size_t n_u = 0;
    std::vector<std::size_t> references; ///< channels
    Eigen::MatrixXd products; ///< (lags + 1) x (channels x references): channel c with reference r is c + m r
    Eigen::VectorXd pairs;    ///< how many products went into a row

    Eigen::Index lags() const { return products.rows() - 1; }
    std::size_t channels() const { return static_cast<std::size_t>(products.cols()) / references.size(); }
};

/// Of so many equal parts of the records, which add up to the whole. A sample with a missing number counts as none.
/// @param set  less its means
std::vector<lag_sums> sum_lags(const record_set& set, const std::vector<std::size_t>& references, std::size_t lags,
                               std::size_t parts);

lag_sums operator+(lag_sums a, const lag_sums& b);
lag_sums operator-(lag_sums a, const lag_sums& b);

/// Responses with what a window exp(-t / constant_s) adds to the decay rates.
struct lag_responses {
    response_set set;
    double constant_s = 0;
    double top_hz = INFINITY; ///< with inputs: up to where the forces have a hundredth of their greatest power
};

/// With inputs (the references): the impulse responses of least squares on the sums (Wiener, Hopf). Without: the correlations
/// of positive lag, which decay as impulse responses do (half-spectra, positive power spectra); the references stand for
/// inputs. In lines of fs / (2 lags).
lag_responses responses_of(const lag_sums& sums, double fs_hz, const std::vector<std::string>& channels);

} // namespace okid_host
