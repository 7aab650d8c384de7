// SPDX-License-Identifier: MIT
#include "free_node.hpp"

#include "missing.hpp"
#include "ring_mask.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr std::int64_t ticks_a_sample = 1000; // so that the fit's unit, the tick, is nothing beside a sample
constexpr double off_ppm = 20000;             // cheap sensors run 1 % off their nominal rate
constexpr double good_enough = 0.02;          // of a sample
constexpr double patience_s = 10;
constexpr double smooth_s = 2; // the place follows the fit in this time
constexpr double jump = 0.25;  // of a sample: further off than this, the place is set again

} // namespace

sample_clock::sample_clock(double rate_hz) : rate_hz_(rate_hz) {
    const drv_clock_config_t config{rate_hz * static_cast<double>(ticks_a_sample), 64, DRV_CLOCK_LATE, 0, off_ppm};
    (void)drv_clock_fit_init(&fit_, &config);
}

void sample_clock::add(std::int64_t index, std::int64_t time_ns) {
    if (first_ns_ == 0) first_ns_ = time_ns;
    last_ns_ = time_ns;
    last_index_ = index;
    const drv_clock_verdict_t verdict =
        drv_clock_fit_add(&fit_, static_cast<std::uint64_t>(index * ticks_a_sample), time_ns);
    if (verdict == DRV_CLOCK_HOST_STEP || verdict == DRV_CLOCK_RESTART) first_ns_ = time_ns; // it is learnt again
}

bool sample_clock::settled() const {
    double sigma_s{};
    std::int64_t at{};
    if (fit_.points < 2 ||
        drv_clock_fit_map(&fit_, static_cast<std::uint64_t>(last_index_ * ticks_a_sample), &at, &sigma_s) != 0)
        return false;
    return sigma_s * rate_hz_ < good_enough || static_cast<double>(last_ns_ - first_ns_) > 1e9 * patience_s;
}

std::int64_t sample_clock::time_ns(std::int64_t index, double* sigma_s) const {
    std::int64_t out{};
    (void)drv_clock_fit_map(&fit_, static_cast<std::uint64_t>(index * ticks_a_sample), &out, sigma_s);
    return out;
}

double sample_clock::index_at(std::int64_t time, double* sigma_s) const {
    const std::int64_t at = time_ns(last_index_, sigma_s); // the fit is a line
    return static_cast<double>(last_index_) + static_cast<double>(time - at) * 1e-9 / period_s();
}

double sample_clock::rate_ppm() const {
    double ppm{};
    (void)drv_clock_fit_rate(&fit_, &ppm, nullptr);
    return ppm;
}

double sample_clock::period_s() const { return (1 + 1e-6 * rate_ppm()) / rate_hz_; }

free_node::free_node(const live_config& part, std::vector<std::size_t> channels, double rate_hz, double ahead_s)
    : grid_(part, *this), channels_(std::move(channels)), clock_(part.rate_hz), kernel_(part.rate_hz / rate_hz),
      half_(static_cast<std::int64_t>(kernel_.half())), width_(channels_.size()),
      mask_(ring_mask(4 * ahead_s * part.rate_hz + 4 * static_cast<double>(half_))),
      rows_((mask_ + 1) * width_, missing_sample), weights_(2 * kernel_.half()) {}

void free_node::on_sample(std::int64_t index, const double* row) {
    std::copy_n(row, width_, &rows_[slot(index) * width_]);
    known_ = index + 1;
    if (const std::int64_t stamp = grid_.time_ns(index)) clock_.add(index, stamp);
}

void free_node::on_missing(std::int64_t index, std::int64_t count) {
    known_ = index + count;
    const std::int64_t first = std::max(index, known_ - static_cast<std::int64_t>(mask_) - 1);
    for (std::int64_t i = first; i < known_; ++i) std::fill_n(&rows_[slot(i) * width_], width_, missing_sample);
}

/// Move on by one wanted sample. @return false: the place had to be set again, signals are torn here
bool free_node::follow(std::int64_t time_ns, double period_s) {
    const double target = clock_.index_at(time_ns, &sigma_s_);
    const double before = place_ + period_s / clock_.period_s(), error = target - before;
    if (!following_ || std::abs(error) > jump) {
        const bool first = !following_;
        following_ = true;
        place_ = target;
        skew_s_ = 0;
        return first;
    }
    const double keep = std::exp(-period_s / smooth_s);
    place_ = before + (1 - keep) * error;
    skew_s_ = -keep * error * clock_.period_s();
    return true;
}

free_node::verdict free_node::sample(std::int64_t number, std::int64_t time_ns, double period_s, bool force,
                                     double* out) {
    std::fill_n(out, width_, missing_sample);
    if (!clock_.settled()) return force ? verdict::missing : verdict::wait;
    if (number != placed_) jumped_ = !follow(time_ns, period_s);
    placed_ = number;
    const double base = std::floor(place_);
    const auto at = static_cast<std::int64_t>(base);
    if (at + half_ >= known_ && !force) return verdict::wait;
    const std::int64_t first = at - half_ + 1;
    if (jumped_ || at + half_ >= known_ || first < 0 || first < known_ - static_cast<std::int64_t>(mask_) - 1)
        return verdict::missing;
    kernel_.weights(place_ - base, weights_.data());
    std::fill_n(out, width_, 0.0);
    for (std::int64_t i = 0; i < 2 * half_; ++i) {
        const double* row = &rows_[slot(first + i) * width_];
        const double weight = weights_[static_cast<std::size_t>(i)];
        for (std::size_t c = 0; c < width_; ++c) out[c] += weight * row[c];
    }
    return verdict::found;
}

gap_cause free_node::cause_of(std::size_t channel, std::int64_t first_ns, std::int64_t last_ns) const {
    const auto own =
        static_cast<std::size_t>(std::find(channels_.begin(), channels_.end(), channel) - channels_.begin());
    if (!clock_.settled()) return gap_cause::stall;
    const auto index = [&](std::int64_t time) { return static_cast<std::int64_t>(clock_.index_at(time, nullptr)); };
    return causes_.find(own, index(first_ns) - half_, index(last_ns) + half_ + 1);
}

} // namespace okid_host
