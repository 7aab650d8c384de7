// SPDX-License-Identifier: MIT
// [publish] samples: the signals themselves as lines for subscribers, in blocks of 50 ms, in engineering units.
#pragma once
#include "config/config.hpp"
#include "publication.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class sample_feed {
  public:
    explicit sample_feed(const live_config& config);

    /// One row of the grid, all channels as decoded, NaN = missing. @return a line when a block is full, else nullptr
    json_line add(std::int64_t index, const double* row);
    /// Rows that nobody has: the block ends, the next begins behind them. @return the block that was begun, or nullptr
    json_line end_block();

  private:
    double rate_hz_;
    std::size_t width_, most_; ///< channels, samples a block
    std::vector<double> scale_, offset_;
    std::vector<double> rows_; ///< of the block, row after row
    std::size_t count_ = 0;
    std::int64_t first_ = 0;
};

} // namespace okid_host
