// SPDX-License-Identifier: MIT
// The assistant of a hammer test: waits for a hit, keeps the samples from before it to the end of the ring-down, and
// accepts or rejects it.
//
// A hit begins where the force crosses `level`. Before it at least as many quiet samples are kept as the identification
// has lags, so that all of it counts.
#pragma once
#include "config/config.hpp"
#include "record/hit_verdict.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// The verdict on a hit.
struct hit_report : hit_verdict {
    int number = 0;             ///< of the hits heard, 1 = the first
    std::int64_t sample = 0;    ///< with which the force crossed the level
    int accepted = 0, left = 0; ///< of all so far
    int point = 0;              ///< where it was struck by the plan; 0: there is none
};

class hammer {
  public:
    /// @param lags  of the identification
    hammer(const live_config& config, std::int64_t lags);

    bool wanted() const { return wanted_.enabled; }
    bool done() const { return wanted() && left_ == 0; }
    bool armed() const { return wanted() && !capturing_ && kept_ >= before_; }
    bool last_good() const { return report_.number > 0 && report_.good(); }
    /// The next samples; NULL = `count` missing ones. No heap. @return true: a hit was judged
    bool add(std::int64_t index, const double* row, std::int64_t count);
    const hit_report& report() const { return report_; }
    /// The rows of the hit just judged, oldest first.
    template <class Visit> void each_row(Visit&& visit) const {
        for (std::size_t i = 0; i < rows(); ++i) visit(at(i));
    }
    /// What the test waits for, in words.
    std::string awaited() const;
    /// How many hits are missing at the end, and the verdicts on the others; "" when all are there.
    std::string shortfall() const;
    int accepted() const { return accepted_; }

  private:
    std::size_t rows() const { return static_cast<std::size_t>(before_ + after_); }
    const double* at(std::size_t i) const {
        return rows_.data() + (static_cast<std::size_t>(next_) + i) % rows() * width_;
    }
    void keep(const double* row);
    bool crosses(const double* row);
    void judge();
    /// Place of the next accepted hit; 0: no plan, or all are there.
    int next_point() const { return wanted_.points.empty() || left_ == 0 ? 0 : wanted_.point_of(accepted_); }

    hammer_config wanted_;
    std::string channel_; ///< its name
    double rate_hz_;
    std::size_t width_;
    std::int64_t before_ = 0, after_ = 0;
    std::vector<hit_channel> judged_;
    hit_window window_;
    std::vector<double> rows_; ///< a ring of before_ + after_ rows
    std::int64_t next_ = 0, kept_ = 0, to_come_ = 0;
    bool capturing_ = false, early_ = false, have_last_ = false;
    double last_ = 0, least_ = 0, most_ = 0; ///< of the force, so far
    int heard_ = 0, left_ = 0, accepted_ = 0;
    hit_report report_;
    std::vector<std::pair<std::string, int>> refused_; ///< how often, by fault
};

} // namespace okid_host
