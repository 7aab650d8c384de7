// SPDX-License-Identifier: MIT
// PURPOSE  power spectra of channels
// METHOD   Welch (1967) with Eigen's FFT
#include "spectrum.hpp"

#include "files/order_statistics.hpp"
#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

namespace okid_host {
namespace {

std::vector<double> between(const std::vector<double>& power, double low, double high) {
    const double lines = 2 * (static_cast<double>(power.size()) - 1);
    std::vector<double> out;
    for (std::size_t i = 0; i < power.size(); ++i)
        if (const double f = static_cast<double>(i) / lines; f >= low && f <= high) out.push_back(power[i]);
    return out;
}

} // namespace

std::vector<double> power_spectrum(const std::vector<std::vector<double>>& records, std::size_t m, std::size_t channel,
                                   std::size_t size) {
    std::vector<double> out(size / 2 + 1, 0.0), window(size), x(size);
    for (std::size_t i = 0; i < size; ++i)
        window[i] = 0.5 - 0.5 * std::cos(2 * M_PI * static_cast<double>(i) / static_cast<double>(size));
    Eigen::FFT<double> fft;
    std::vector<std::complex<double>> lines;
    double segments = 0;
    for (const auto& rows : records)
        for (std::size_t first = 0; (first + size) * m <= rows.size(); first += size / 2) {
            double sum = 0;
            for (std::size_t i = 0; i < size; ++i) sum += x[i] = rows[(first + i) * m + channel];
            if (std::isnan(sum)) continue;
            for (std::size_t i = 0; i < size; ++i) x[i] = (x[i] - sum / static_cast<double>(size)) * window[i];
            fft.fwd(lines, x);
            for (std::size_t i = 0; i < out.size(); ++i) out[i] += std::norm(lines[i]);
            ++segments;
        }
    if (segments == 0) return {};
    for (double& power : out) power /= segments;
    return out;
}

double mean_power(const std::vector<double>& power, double low, double high) {
    const std::vector<double> band = between(power, low, high);
    double sum = 0;
    for (const double value : band) sum += value;
    return band.empty() ? 0 : sum / static_cast<double>(band.size());
}

double median_power(const std::vector<double>& power, double low, double high) {
    std::vector<double> band = between(power, low, high);
    return band.empty() ? 0 : upper_median(band);
}

} // namespace okid_host
