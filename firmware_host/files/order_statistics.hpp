// SPDX-License-Identifier: MIT
// Medians and quantiles of numbers without NaN.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace okid_host {

/// The value at this place, 0 = the smallest, if `values` were sorted. They are reordered; the place must exist.
template <class Number> Number in_order(std::vector<Number>& values, std::size_t place) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(place);
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// One of the values: of an even number the upper one of the two in the middle. NaN of none; `values` are reordered.
inline double upper_median(std::vector<double>& values) {
    return values.empty() ? NAN : in_order(values, values.size() / 2);
}

/// Of an even number the mean of the two in the middle. NaN of none.
inline double median(std::vector<double> values) {
    const double high = upper_median(values);
    if (values.empty() || values.size() % 2) return high;
    return (high + in_order(values, values.size() / 2 - 1)) / 2;
}

/// How far values are off one of them, as the deviation of a normal distribution; 0 of fewer than 100.
inline double usual_distance(std::vector<double> values, double centre) {
    for (double& v : values) v = std::abs(v - centre);
    return values.size() < 100 ? 0 : 1.4826 * upper_median(values);
}

/// One of the values, with this share (0 to 1) of the others below it; there must be one.
template <class Number> Number quantile(std::vector<Number> values, double share) {
    return in_order(values, static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

} // namespace okid_host
