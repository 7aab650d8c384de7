// SPDX-License-Identifier: MIT
// Channels of which nothing comes while others go on: each is named once, after a second.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class silence_watch {
  public:
    silence_watch(std::size_t channels, double rate_hz)
        : patience_(static_cast<std::int64_t>(std::floor(rate_hz)) + 1), runs_(channels) {}

    /// The next row of the grid. Calls to(channel, first missing sample) for each that now lacks more than a second of rows
    /// in which others have a number.
    template <class To> void add(std::int64_t index, const double* row, const To& to) {
        const double* const end = row + runs_.size();
        const bool any = !std::all_of(row, end, [](double x) { return std::isnan(x); });
        for (std::size_t c = 0; c < runs_.size(); ++c) {
            run& its = runs_[c];
            if (!std::isnan(row[c])) {
                its = {};
                continue;
            }
            if (its.first < 0) its.first = index;
            if (any && ++its.alone == patience_) to(c, its.first);
        }
    }
    /// Rows from `index` on are missing on all channels.
    void add_missing(std::int64_t index) {
        for (run& each : runs_)
            if (each.first < 0) each.first = index;
    }

  private:
    struct run {
        std::int64_t first = -1, alone = 0; ///< alone: rows in which others have a number
    };
    std::int64_t patience_;
    std::vector<run> runs_;
};

} // namespace okid_host
