// SPDX-License-Identifier: MIT
// Noise that is not white: the filter that makes it so, applied to all channels, leaves the structure as it is.
#pragma once
#include <okid/model.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

/// Samples of runs, one after the other: inputs, then outputs; NaN: missing.
struct sample_runs {
    std::vector<std::int32_t> counts;
    std::vector<double> samples;
};

/// Autocorrelations at lags 0, 1, … of what a model leaves of the outputs: each output and run less its mean, the outputs
/// weighted by one over their mean squares, so that the first is 1. @param x0  n_z numbers a run
std::vector<double> residual_correlation(const okid_model_t& model, const double* x0, const sample_runs& runs);

/// The prediction error filter 1, f_1, … of noise with such autocorrelations, of the order that Akaike's criterion takes.
/// @param samples  that the autocorrelations are of
std::vector<double> whitening_filter(const std::vector<double>& correlation, double samples);

/// Append v(t) + f_1 v(t - 1) + … of `count` samples in a row: none of the first ones, which have no past.
void filter_run(const std::vector<double>& filter, std::size_t channels, const double* samples, std::size_t count,
                std::vector<double>& out);

/// v(t) <- v(t) + f_1 v(t - 1) + … in every run. The first samples of a run, which have no past, go, and so do
/// runs of which less than `least` samples would stay.
void filter_runs(const std::vector<double>& filter, std::size_t channels, std::size_t least, sample_runs& runs);

} // namespace okid_host
