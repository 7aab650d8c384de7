// SPDX-License-Identifier: MIT
#include "fir_kernel.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double zero_crossings = 32;
constexpr double kaiser_shape = 10.06; // 0.1102 (100 dB - 8.7)
constexpr double pi = 3.14159265358979323846;

double sinc(double x) { return x == 0 ? 1 : std::sin(pi * x) / (pi * x); }

/// Modified Bessel function I0 by its power series; std::cyl_bessel_i is not in every C++ library.
double bessel_i0(double x) {
    double sum = 1, term = 1;
    for (int k = 1; term > 1e-17 * sum; ++k) sum += term *= x * x / (4.0 * k * k);
    return sum;
}

double kaiser(double x) { return std::abs(x) >= 1 ? 0 : bessel_i0(kaiser_shape * std::sqrt(1 - x * x)); }

} // namespace

fir_kernel::fir_kernel(double ratio, std::size_t phases)
    : phases_(phases), half_(static_cast<std::size_t>(std::ceil(zero_crossings * std::max(1.0, ratio)))) {
    const double band = 1 / std::max(1.0, ratio);
    const std::size_t taps = 2 * half_;
    table_.resize((phases_ + 1) * taps);
    for (std::size_t phase = 0; phase <= phases_; ++phase) {
        double* row = &table_[phase * taps];
        double sum = 0;
        for (std::size_t i = 0; i < taps; ++i) {
            const double t = static_cast<double>(i) + 1 - static_cast<double>(half_) -
                             static_cast<double>(phase) / static_cast<double>(phases_);
            row[i] = sinc(band * t) * kaiser(t / static_cast<double>(half_));
            sum += row[i];
        }
        for (std::size_t i = 0; i < taps; ++i) row[i] /= sum;
    }
}

void fir_kernel::weights(double fraction, double* out) const {
    const double at = fraction * static_cast<double>(phases_);
    const auto low = std::min(static_cast<std::size_t>(at), phases_ - 1);
    const double between = at - static_cast<double>(low);
    const double *a = &table_[low * 2 * half_], *b = a + 2 * half_;
    for (std::size_t i = 0; i < 2 * half_; ++i) out[i] = a[i] + between * (b[i] - a[i]);
}

} // namespace okid_host
