// SPDX-License-Identifier: MIT
// One sample out for every `factor` that come in, behind a linear-phase anti-alias filter (fir_kernel.hpp), the same for
// all channels and without delay. A sample whose filter meets a missing one is missing.
#pragma once
#include "consensus/fir_kernel.hpp"
#include "gap_marker.hpp"

#include <cstdint>
#include <vector>

namespace okid_host {

class decimator : public grid_sink, private cause_source {
  public:
    decimator(std::size_t channels, int factor, grid_sink& to);

    void on_sample(std::int64_t index, const double* row) override { add(index, row); }
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap& gap) override { causes_.add(gap); }

    /// Gaps that are open are reported; samples whose filter reaches beyond the end are left off.
    void finish() { gaps_.finish(*this, to_); }
    void set_limit(std::int64_t count) { limit_ = count; }
    std::int64_t emitted() const { return gaps_.rows(); }
    grid_channel_counts channel(std::size_t index) const { return gaps_.channel(index); }
    /// Sample `index` of the output is that of the input with this number.
    std::int64_t source_index(std::int64_t index) const { return index * factor_ + half_; }
    /// Stamps of input samples are kept as long as their output sample waits.
    void note_time(std::int64_t index, std::int64_t time_ns) { times_[slot(index)] = time_ns; }
    std::int64_t time_ns(std::int64_t index) const { return times_[slot(source_index(index))]; }

  private:
    gap_cause cause_of(std::size_t channel, std::int64_t first, std::int64_t last) const override;
    void add(std::int64_t index, const double* row);
    std::size_t slot(std::int64_t index) const { return static_cast<std::size_t>(index) & mask_; }

    grid_sink& to_;
    fir_kernel kernel_;
    std::int64_t factor_, half_, limit_;
    std::size_t width_, mask_;
    std::vector<double> weights_, rows_, out_, nothing_;
    std::vector<std::int64_t> times_;
    gap_marker gaps_;
    cause_memory causes_;
};

} // namespace okid_host
