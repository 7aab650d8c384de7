// SPDX-License-Identifier: MIT
// [publish] samples: the signals themselves as lines for subscribers, in blocks of 50 ms, in engineering units.
#pragma once
#include "config/config.hpp"
#include "publication.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

class sample_feed {
  public:
    /// @param extra  channels behind those of the grid, which come with standard deviations
    explicit sample_feed(const live_config& config, std::size_t extra = 0);

    /// One row of the grid, all channels as decoded, NaN = missing, nullptr = all are; then the extra ones, values and
    /// standard deviations. @return a line when a block is full, else nullptr
    json_line add(std::int64_t index, const double* row, const double* extra = nullptr);
    /// Missing rows: the block ends, the next begins behind them. @return the block that was begun, or nullptr
    json_line end_block();

  private:
    void append(std::string& out, std::size_t column) const;

    double rate_hz_;
    std::size_t extra_, width_, most_; ///< channels: extra ones, all; samples a block
    std::vector<double> scale_, offset_;
    std::vector<double> rows_; ///< of the block, row after row
    std::vector<double> std_;  ///< of the extra channels, the largest of the block
    std::size_t count_ = 0;
    std::int64_t first_ = 0;
};

} // namespace okid_host
