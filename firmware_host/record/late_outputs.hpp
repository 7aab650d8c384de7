// SPDX-License-Identifier: MIT
// Outputs that come late, from shapes alone: the points of a structure move in phase, a sensor that is late by tau lags by w tau.
#pragma once
#include <complex>
#include <string>
#include <vector>

namespace okid_host {

/// A shape, and the variance of each entry, re and im together.
struct seen_shape {
    double frequency_hz = 0;
    std::vector<std::complex<double>> shape;
    std::vector<double> variance;
};

struct late_output {
    std::size_t output = 0;
    double seconds = 0; ///< after those that are not
    double std = 0;     ///< s
};

/// The outputs that are late by four deviations or more, where one delay for each output explains what no real shape does; else
/// none. A delay is known up to a period of the highest mode. Three modes or more, two outputs or more.
/// Cost: one angle an entry where the shapes are real; else 200 products an entry, sixty times at most.
std::vector<late_output> late_outputs(const std::vector<seen_shape>& modes);

/// "a3 20.1 ms, a4 19.8 ms": at most six.
std::string late_text(const std::vector<late_output>& late, const std::vector<std::string>& outputs);

} // namespace okid_host
