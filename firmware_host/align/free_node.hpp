// SPDX-License-Identifier: MIT
// A node whose samples come by its own clock: where they stand on the host's clock, and its signals at any time between.
//
// The node's samples are counted (by its counter or its cadence: grid.hpp); count and time of arrival give its clock
// (clock_fit.h). The place of a wanted time among the samples follows that fit smoothly, so that a fit that gets better
// bends no sine; the samples there come out of a band-limited filter (fir_kernel.hpp). Nothing is made up: where the
// filter meets a missing sample, the result is missing.
#pragma once
#include "consensus/fir_kernel.hpp"
#include "gap_marker.hpp"

#include <drv/clock_fit.h>

#include <cstdint>
#include <vector>

namespace okid_host {

/// A count of samples against the host's clock.
class sample_clock {
  public:
    explicit sample_clock(double rate_hz);
    void add(std::int64_t index, std::int64_t time_ns);
    /// The fit is as good as it gets soon: σ below 2 % of a sample, or ten seconds have passed.
    bool settled() const;
    /// Host time of a sample, ns, and its σ in seconds. Only when settled.
    std::int64_t time_ns(std::int64_t index, double* sigma_s) const;
    /// Which sample (with fraction) stands at a host time. Only when settled.
    double index_at(std::int64_t time_ns, double* sigma_s) const;
    /// Seconds between two samples, on the host's clock.
    double period_s() const;
    double rate_ppm() const;

  private:
    drv_clock_fit_t fit_{};
    double rate_hz_;
    std::int64_t first_ns_ = 0, last_ns_ = 0, last_index_ = 0;
};

class free_node : private grid_sink {
  public:
    /// @param part      the configuration with this node's channels only, rate_hz its own
    /// @param channels  their numbers in the whole configuration
    /// @param rate_hz   of the samples wanted; @param ahead_s  how far the node may run ahead of them
    free_node(const live_config& part, std::vector<std::size_t> channels, double rate_hz, double ahead_s);

    void push(const drv_frame_t& frame) { grid_.push(frame); }
    void finish() { grid_.finish(); }
    void set_link(std::size_t bus, bool down) { grid_.set_link(bus, down); }
    bool settled() const { return clock_.settled(); }

    enum class verdict { wait, missing, found };
    /// The node's channels at a host time. Sample `number` is asked for until it is found or missing, then the next one, a
    /// period later. `wait`: samples are still to come, unless `force`, which makes them missing.
    verdict sample(std::int64_t number, std::int64_t time_ns, double period_s, bool force, double* out);

    const std::vector<std::size_t>& channels() const { return channels_; }
    const grid& samples() const { return grid_; }
    /// Why samples near that time are missing; `channel` is one of the whole configuration.
    gap_cause cause_of(std::size_t channel, std::int64_t first_ns, std::int64_t last_ns) const;
    double skew_s() const { return skew_s_; }        ///< by which the newest samples are off the fit
    double skew_sigma_s() const { return sigma_s_; } ///< of the fit at the newest sample
    double rate_ppm() const { return clock_.rate_ppm(); }

  private:
    void on_sample(std::int64_t index, const double* row) override;
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap& gap) override { causes_.add(gap); }
    bool follow(std::int64_t time_ns, double period_s);
    std::size_t slot(std::int64_t index) const { return static_cast<std::size_t>(index) & mask_; }

    grid grid_;
    std::vector<std::size_t> channels_;
    sample_clock clock_;
    fir_kernel kernel_;
    std::int64_t half_, known_ = 0; ///< known_: samples decided
    std::size_t width_, mask_;
    std::vector<double> rows_, weights_;
    bool following_ = false;
    double place_ = 0, skew_s_ = 0, sigma_s_ = 0;
    std::int64_t placed_ = -1; ///< the sample that place_ is for
    bool jumped_ = false;
    cause_memory causes_;
};

} // namespace okid_host
