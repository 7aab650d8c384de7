// SPDX-License-Identifier: MIT
// PURPOSE    upper tail of the F distribution: f_distribution.hpp
// METHOD     f_distribution.hpp
// REFERENCE  f_distribution.hpp
// NUMERICS   f_distribution.hpp
// WORKSPACE  none
#include "f_distribution.hpp"

#include <cmath>
#include <limits>

namespace okid {
namespace {

double away_from_zero(double x) { return std::abs(x) < 1e-300 ? 1e-300 : x; }

/// The continued fraction of I_x(a, b), quick for x < (a + 1) / (a + b + 2).
double fraction(double x, double a, double b) {
    double c = 1, d = 1 / away_from_zero(1 - (a + b) * x / (a + 1)), value = d;
    for (int m = 1; m <= 100000; ++m) {
        const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        d = 1 / away_from_zero(1 + even * d);
        c = away_from_zero(1 + even / c);
        value *= d * c;
        const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        d = 1 / away_from_zero(1 + odd * d);
        c = away_from_zero(1 + odd / c);
        value *= d * c;
        if (std::abs(d * c - 1) < 1e-15) break;
    }
    return value;
}

/// I_x(a, b), y = 1 - x.
double incomplete_beta(double x, double y, double a, double b) {
    if (!(x > 0)) return 0;
    if (!(y > 0)) return 1;
    const double front =
        std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log(y));
    return x < (a + 1) / (a + b + 2) ? front * fraction(x, a, b) / a : 1 - front * fraction(y, b, a) / b;
}

} // namespace

double f_upper_tail(double x, double a, double b) {
    if (!(a > 0) || !(b > 0) || std::isnan(x)) return std::numeric_limits<double>::quiet_NaN();
    if (x <= 0) return 1;
    const double whole = b + a * x;
    return incomplete_beta(b / whole, a * x / whole, b / 2, a / 2);
}

} // namespace okid
