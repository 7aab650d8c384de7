// SPDX-License-Identifier: MIT
// Samples to frames: the inverse of the grid, for logs made from tables.
#pragma once
#include "config/config.hpp"

#include <drv/frame.h>

#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

class frame_maker {
  public:
    explicit frame_maker(const live_config& config);

    /// The frames of one sample as lines of a log. A frame with a missing number (NaN) is left out; its count goes on.
    /// @param row  one number a channel in the units of si_unit()
    void append_sample(std::int64_t index, const double* row, std::string& text);

    long long frames() const { return frames_; }
    long long saturated() const { return saturated_; }

  private:
    struct message {
        std::vector<std::size_t> channels;
        drv_frame_t frame{};
        std::string interface;
    };
    void put_into_pages();
    bool fill(const message& from, std::int64_t index, const double* row, drv_frame_t& frame);

    const live_config& config_;
    std::vector<message> messages_;
    double period_ns_, between_ns_;
    long long frames_ = 0, saturated_ = 0;
};

} // namespace okid_host
