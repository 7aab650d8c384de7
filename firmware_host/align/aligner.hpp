// SPDX-License-Identifier: MIT
// Channels of all buses and nodes onto the sample grid of a session.
//
// Nodes that count the same samples (SYNC, one counter) need a `grid` and no more. A bus with `clock = "free"` carries
// nodes that sample by clocks of their own, one for each message: their signals are resampled at the times of the
// reference, which are the counted channels, or without any the node of the first channel. With `decimate` all channels
// pass one anti-alias filter afterwards. Every filter is symmetric: no channel is delayed against another.
#pragma once
#include "decimator.hpp"
#include "free_node.hpp"
#include "gap_marker.hpp"
#include "grid.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace okid_host {

/// How well the clock of a channel's node is known beside the reference.
struct clock_skew {
    std::size_t channel = 0;
    double us = 0, std_us = 0; ///< what the smooth place is off the fit by now, and σ of both fits
    double rate_ppm = 0;       ///< by which the node's second is longer than the reference's: a fast clock is negative
};

class aligner : private grid_sink, private cause_source {
  public:
    aligner(const live_config& config, grid_sink& sink);

    /// Decode a frame and place it. No heap.
    void push(const drv_frame_t& frame);
    /// The stream ends: everything that waits goes out. Samples whose filter reaches beyond the end are left off.
    void finish();
    /// Let no sample from `count` on go out.
    void set_limit(std::int64_t count);
    /// The interface of a bus went down, or is up.
    void set_link(std::size_t bus, bool down);
    std::int64_t emitted() const; ///< samples given to the sink, missing ones included
    /// The earliest time stamp of a sample the sink was just given.
    std::int64_t time_ns(std::int64_t index) const;
    grid_bus_counts bus(std::size_t index) const;
    grid_channel_counts channel(std::size_t index) const;
    /// Channels of which no frame was ever received.
    std::vector<std::size_t> silent_channels() const;
    /// Of channels on clocks of their own, once the grid has begun.
    std::vector<clock_skew> skews() const;

  private:
    void on_sample(std::int64_t index, const double* row) override;
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap& gap) override;
    grid_channel_counts counted(std::size_t index) const;
    gap_cause cause_of(std::size_t channel, std::int64_t first, std::int64_t last) const override;

    void take(std::int64_t index, const double* row, std::int64_t stamp);
    void drain();
    bool begin();
    bool emit(bool force);
    void hand_on(std::int64_t index, const double* row, std::int64_t count);
    std::size_t slot(std::int64_t index) const { return static_cast<std::size_t>(index) & mask_; }

    grid_sink& sink_;
    std::unique_ptr<decimator> decimator_;
    std::vector<std::size_t> counted_; ///< channels of the reference
    std::vector<std::unique_ptr<free_node>> nodes_;
    std::unique_ptr<grid> reference_;
    std::size_t width_;
    // Only with free nodes: rows of the reference that wait for them.
    sample_clock clock_;
    std::int64_t wait_ = 0,
                 patience_ = 0; ///< samples: how far the reference may be ahead; how long the begin is waited for
    std::size_t mask_ = 0;
    std::vector<double> waiting_, row_, part_;
    std::vector<std::int64_t> stamps_;
    std::int64_t taken_ = 0, next_ = 0,
                 origin_ = -1; ///< reference samples taken in, next to go out, the first that goes out
    std::int64_t limit_;
    gap_marker gaps_;
    cause_memory causes_;
};

} // namespace okid_host
