// SPDX-License-Identifier: MIT
// How a number that did not arrive stands in a row of samples.
#pragma once
#include <limits>

namespace okid_host {

constexpr double missing_sample = std::numeric_limits<double>::quiet_NaN();

} // namespace okid_host
