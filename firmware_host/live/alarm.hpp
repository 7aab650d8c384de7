// SPDX-License-Identifier: MIT
// Has a tracked mode left its baseline? The baseline of a mode is the mean of its frequency over its first updates at rest,
// each weighted by its variance. How much a single update scatters the jackknife shows, and the updates themselves, of
// which neighbours share most of their samples: their scatter is scaled to what independent ones would show. A mode is away
// when two updates in a row are more than k sigma off, sigma^2 = that of the baseline + that of the update; it is back
// within k/2 sigma. One alarm stands as long as any mode is away.
#pragma once
#include "config/config.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace okid_host {

/// A mode at an update, as the alarm sees it.
struct observed_mode {
    int track;
    double frequency_hz, sigma_hz; ///< sigma NaN: the update says nothing about it
    bool at_rest;
};

struct departure {
    int track;
    double frequency_hz, baseline_hz, sigma_hz;
};

class alarm_watch {
  public:
    explicit alarm_watch(const alarm_config& config) : config_(config) {}

    /// @param first, end  samples the update rests on
    /// @param steps  updates since the last call, 1 = none was left out: the time of a baseline is that of the stream
    /// @return true when an alarm begins or ends with it
    bool update(const std::vector<observed_mode>& modes, std::int64_t first, std::int64_t end, int steps = 1);
    bool standing() const { return standing_; }
    /// Modes that are away by the newest update in which they were seen, the farthest (in sigma) first.
    const std::vector<departure>& away() const { return away_; }
    bool is_away(int track) const;

  private:
    struct baseline {
        int track = 0, updates = 0, steps = 0, beyond = 0, unseen = 0;
        bool away = false;
        double weight = 0, mean = 0, scatter = 0; ///< sums over weights 1 / sigma^2
        std::int64_t begun = 0;                   ///< end of the first update in it
        double sigma = 0;                         ///< of one update, once there are enough
        departure newest{};
    };
    baseline& of(int track);
    void learn(baseline& to, const observed_mode& mode, std::int64_t first, std::int64_t end, int steps) const;
    void judge(baseline& to, const observed_mode& mode) const;

    alarm_config config_;
    std::vector<baseline> all_;
    std::vector<departure> away_;
    bool standing_ = false;
};

} // namespace okid_host
