// SPDX-License-Identifier: MIT
// Means of any stretch of a channel, from sums up to each sample; NaN: missing.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace okid_host {

class stretch_means {
  public:
    stretch_means(const double* x, std::size_t stride, std::size_t count) : sum_(count + 1), known_(count + 1) {
        for (std::size_t i = 0; i < count; ++i) {
            const double value = x[i * stride];
            const bool known = !std::isnan(value);
            sum_[i + 1] = sum_[i] + (known ? value : 0);
            known_[i + 1] = known_[i] + (known ? 1 : 0);
        }
    }
    /// Of samples first .. last-1; NaN where none is known.
    double of(std::size_t first, std::size_t last) const { return (sum_[last] - sum_[first]) / known(first, last); }
    /// How many of them are there.
    double known(std::size_t first, std::size_t last) const { return known_[last] - known_[first]; }

  private:
    std::vector<double> sum_, known_;
};

} // namespace okid_host
