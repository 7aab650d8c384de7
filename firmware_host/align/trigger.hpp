// SPDX-License-Identifier: MIT
// When does identification begin? Until the trigger comes, samples wait here as far back as they may still be needed:
// pretrigger_s, and for a GPIO line a second more, since an edge can be reported after the frames that follow it.
//
// The trigger sample is the first one whose time stamp is not before the edge, or the one with which a channel crosses
// the level (from below to the level or above, or the other way). That depends on the stream alone, not on how fast it
// is played.
#pragma once
#include "config/config.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

class trigger {
  public:
    explicit trigger(const live_config& config);

    bool waiting() const { return waiting_; }
    /// An edge of the GPIO line, host time (drv/host_clock.h). The first one counts.
    void edge(std::int64_t time_ns);
    /// A sample while waiting; NULL = `count` missing ones. @return true when the trigger has come
    bool add(std::int64_t index, const double* row, std::int64_t count, std::int64_t time_ns);
    /// The same for an edge that lies among the samples kept. @return true when it does
    bool look_back();

    std::int64_t sample() const { return sample_; } ///< of the trigger, once it has come
    std::int64_t time_ns() const { return time_ns_; }
    /// Samples from pretrigger_s before it on, oldest first: visit(index, row, count), row NULL where missing.
    template <class Visit> void each_kept(Visit&& visit) const {
        for (std::size_t k = 0; k < used_; ++k) {
            const entry& one = entries_[(first_ + k) % entries_.size()];
            const std::int64_t from = std::max(one.index, sample_ - pretrigger_), end = one.index + one.count;
            if (from < end) visit(from, one.missing ? nullptr : row_of(one), end - from);
        }
    }
    /// What is waited for, for people.
    std::string awaited() const;
    /// Why it never came.
    std::string missed() const;

  private:
    struct entry {
        std::int64_t index = 0, count = 0, time_ns = 0;
        bool missing = false;
    };
    void keep(std::int64_t index, const double* row, std::int64_t count, std::int64_t time_ns);
    bool crosses(const double* row);
    bool come(std::int64_t sample, std::int64_t time_ns);
    const double* row_of(const entry& one) const {
        return rows_.data() + static_cast<std::size_t>(&one - entries_.data()) * width_;
    }

    trigger_config wanted_;
    std::string channel_, unit_;
    double scale_ = 1, offset_ = 0; ///< of the channel, to its own unit
    std::size_t width_;
    std::int64_t pretrigger_;
    bool waiting_;
    std::vector<entry> entries_; ///< a ring
    std::vector<double> rows_;
    std::size_t first_ = 0, used_ = 0;
    std::optional<std::int64_t> edge_ns_;
    std::optional<double> before_; ///< level: the last number of the channel
    double least_ = 0, most_ = 0;  ///< level: its numbers so far
    std::int64_t sample_ = 0, time_ns_ = 0;
};

} // namespace okid_host
