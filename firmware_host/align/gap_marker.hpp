// SPDX-License-Identifier: MIT
// Runs of missing samples in rows that go out, reported as gaps; and how many samples each channel has.
#pragma once
#include "grid.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

namespace okid_host {

/// Why a channel lacks samples; asked once for each run, when it ends.
class cause_source {
  public:
    virtual ~cause_source() = default;
    virtual gap_cause cause_of(std::size_t channel, std::int64_t first, std::int64_t last) const = 0;
};

class gap_marker {
  public:
    explicit gap_marker(std::size_t channels) : first_(channels, -1), received_(channels, 0) {}

    /// The next row, before it goes out: gaps that end here are reported.
    void row(const double* numbers, const cause_source& causes, grid_sink& sink) {
        for (std::size_t c = 0; c < first_.size(); ++c) {
            const bool missing = std::isnan(numbers[c]);
            received_[c] += !missing;
            if (missing && first_[c] < 0) first_[c] = rows_;
            if (!missing) close(c, causes, sink);
        }
        ++rows_;
    }
    /// So many rows without any number.
    void missing(std::int64_t count) {
        for (std::int64_t& first : first_)
            if (first < 0) first = rows_;
        rows_ += count;
    }
    /// The stream ends: gaps that are open are reported.
    void finish(const cause_source& causes, grid_sink& sink) {
        for (std::size_t c = 0; c < first_.size(); ++c) close(c, causes, sink);
    }
    std::int64_t rows() const { return rows_; }
    grid_channel_counts channel(std::size_t c) const { return {rows_, received_[c]}; }

  private:
    void close(std::size_t c, const cause_source& causes, grid_sink& sink) {
        if (first_[c] < 0) return;
        const std::int64_t last = rows_ - 1;
        sink.on_gap({c, first_[c], last, rows_ - first_[c], causes.cause_of(c, first_[c], last)});
        first_[c] = -1;
    }

    std::int64_t rows_ = 0;
    std::vector<std::int64_t> first_; ///< of the run that is open, -1 = none
    std::vector<std::int64_t> received_;
};

/// The causes of the newest gaps of some channels, by where they lay.
class cause_memory {
  public:
    void add(const grid_gap& gap) { newest_[count_++ % newest_.size()] = gap; }
    /// The cause of a gap of that channel that touches first … last; a stall when none is known.
    gap_cause find(std::size_t channel, std::int64_t first, std::int64_t last) const {
        for (std::size_t i = 0; i < newest_.size() && i < count_; ++i) {
            const grid_gap& gap = newest_[(count_ - 1 - i) % newest_.size()];
            if (gap.channel == channel && gap.first <= last && gap.last >= first) return gap.cause;
        }
        return gap_cause::stall;
    }

  private:
    std::array<grid_gap, 256> newest_{};
    std::size_t count_ = 0;
};

} // namespace okid_host
