// SPDX-License-Identifier: MIT
// Power of a channel over frequency (Welch), for questions about records: where their power lies.
#pragma once
#include <cstddef>
#include <vector>

namespace okid_host {

/// Mean power of `size` samples at a time under a Hann window, half overlapping, at 0 … size / 2; segments with a missing
/// sample are left out. Empty: no segment is whole.
/// @param records  rows of m numbers; @param size  a power of two
std::vector<double> power_spectrum(const std::vector<std::vector<double>>& records, std::size_t m, std::size_t channel,
                                   std::size_t size);

/// Mean and median of a spectrum between two frequencies in shares of the sample rate.
double mean_power(const std::vector<double>& power, double low, double high);
double median_power(const std::vector<double>& power, double low, double high);

} // namespace okid_host
