// SPDX-License-Identifier: MIT
// PURPOSE  samples a second by their time stamps
// METHOD   an arrival is never early, and may be late by a burst or a stall: of each stretch of samples the earliest is kept,
//          at most 64 of them (two become one when they are full); the edge of their lower hull over the middle is the line;
//          a step of the stamps against the numbers is taken out
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace okid_host {

class rate_meter {
  public:
    explicit rate_meter(double rate_hz) : period_s_(1 / rate_hz) {}

    /// Samples in the order of their numbers; one of which nothing came has the time 0 and is left out.
    void add(std::int64_t index, std::int64_t time_ns) {
        if (time_ns == 0) return;
        if (count_ == 0) origin_ = {index, 0}, origin_ns_ = time_ns;
        double late_s =
            static_cast<double>(time_ns - origin_ns_) * 1e-9 - static_cast<double>(index - origin_.index) * period_s_;
        if (std::abs(late_s - newest_s_) > std::max(jump_s, jump_samples * period_s_)) {
            origin_ns_ += static_cast<std::int64_t>((late_s - newest_s_) * 1e9);
            late_s = newest_s_;
        }
        newest_s_ = late_s;
        if (count_ > 0 && index < end_) {
            if (late_s < points_[count_ - 1].late_s) points_[count_ - 1] = {index, late_s};
            return;
        }
        if (count_ == points_.size()) halve();
        points_[count_++] = {index, late_s};
        end_ = index + width_;
    }
    /// 0 before there are two stretches of samples.
    double rate_hz() const {
        if (count_ < 2) return 0;
        std::array<point, 64> hull{};
        std::size_t n = 0;
        for (std::size_t i = 0; i < count_; ++i) {
            while (n > 1 && slope(hull[n - 2], hull[n - 1]) >= slope(hull[n - 1], points_[i])) --n;
            hull[n++] = points_[i];
        }
        const std::int64_t middle = (hull[0].index + hull[n - 1].index) / 2;
        std::size_t k = 1;
        while (hull[k].index <= middle) ++k;
        const double period_s = period_s_ + slope(hull[k - 1], hull[k]);
        return period_s > 0 ? 1 / period_s : 0;
    }

  private:
    static constexpr double jump_s = 10, jump_samples = 100; ///< no late arrival: the clock was set, or a sender rested
    struct point {
        std::int64_t index = 0;
        double late_s = 0; ///< of a stream at the nominal rate
    };
    static double slope(const point& a, const point& b) {
        return (b.late_s - a.late_s) / static_cast<double>(b.index - a.index);
    }
    void halve() {
        for (std::size_t i = 0; i < points_.size() / 2; ++i) {
            const point &a = points_[2 * i], &b = points_[2 * i + 1];
            points_[i] = a.late_s < b.late_s ? a : b;
        }
        count_ = points_.size() / 2;
        width_ *= 2;
    }

    double period_s_;
    std::array<point, 64> points_{};
    std::size_t count_ = 0;
    double newest_s_ = 0;
    std::int64_t width_ = 50, end_ = 0, origin_ns_ = 0;
    point origin_;
};

} // namespace okid_host
