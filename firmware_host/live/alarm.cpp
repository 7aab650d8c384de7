// SPDX-License-Identifier: MIT
#include "alarm.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr int confirm = 2;     // updates in a row
constexpr int forgotten = 200; // updates without a mode: its track has ended

/// Updates spread evenly over `span` samples, each of the last `basis` samples: by how much does the variance about their
/// mean fall short of that of independent ones? The correlation of two that are s apart is 1 - s/basis.
double independence(double span, double basis) {
    const double x = span / basis;
    const double shared = x <= 1 ? 1 - x / 3 : (1 - 1 / (3 * x)) / x;
    return std::max(1 - shared, 0.1); // below that there is too little to judge by
}

} // namespace

alarm_watch::baseline& alarm_watch::of(int track) {
    for (baseline& each : all_)
        if (each.track == track) return each;
    all_.emplace_back().track = track;
    return all_.back();
}

void alarm_watch::learn(baseline& to, const observed_mode& mode, std::int64_t first, std::int64_t end,
                        int steps) const {
    if (!mode.at_rest) return;
    to.steps += to.updates > 0 ? steps : 1;
    const double weight = 1 / (mode.sigma_hz * mode.sigma_hz), before = to.mean;
    if (to.updates == 0) to.begun = end;
    to.weight += weight;
    to.mean += weight / to.weight * (mode.frequency_hz - before);
    to.scatter += weight * (mode.frequency_hz - before) * (mode.frequency_hz - to.mean);
    ++to.updates;
    if (to.steps < config_.baseline_updates) return;
    const double expected = to.updates / to.weight; // harmonic mean of the variances
    const double seen =
        to.scatter / to.weight / independence(static_cast<double>(end - to.begun), static_cast<double>(end - first));
    to.sigma = std::sqrt(std::max(expected, to.updates > 2 ? seen : 0.0));
}

void alarm_watch::judge(baseline& to, const observed_mode& mode) const {
    const double sigma = std::hypot(to.sigma, mode.sigma_hz);
    const double off = std::abs(mode.frequency_hz - to.mean) / sigma;
    to.newest = {to.track, mode.frequency_hz, to.mean, sigma};
    to.beyond = off > config_.k_sigma ? to.beyond + 1 : 0;
    if (to.beyond >= confirm) to.away = true;
    if (off < config_.k_sigma / 2) to.away = false;
}

bool alarm_watch::update(const std::vector<observed_mode>& modes, std::int64_t first, std::int64_t end, int steps) {
    if (!config_.enabled) return false;
    for (const observed_mode& mode : modes) {
        if (mode.track <= 0 || !(mode.sigma_hz > 0) || !std::isfinite(mode.sigma_hz)) continue;
        baseline& one = of(mode.track);
        one.unseen = 0;
        if (one.steps < config_.baseline_updates)
            learn(one, mode, first, end, steps);
        else
            judge(one, mode);
    }
    all_.erase(std::remove_if(all_.begin(), all_.end(),
                              [&](baseline& each) { return (each.unseen += steps) > forgotten && !each.away; }),
               all_.end());
    away_.clear();
    for (const baseline& each : all_)
        if (each.away) away_.push_back(each.newest);
    const auto in_sigma = [](const departure& d) { return std::abs(d.frequency_hz - d.baseline_hz) / d.sigma_hz; };
    std::sort(away_.begin(), away_.end(), [&](const departure& a, const departure& b) {
        return in_sigma(a) != in_sigma(b) ? in_sigma(a) > in_sigma(b) : a.track < b.track;
    });
    const bool before = standing_;
    standing_ = !away_.empty();
    return standing_ != before;
}

bool alarm_watch::is_away(int track) const {
    return std::any_of(away_.begin(), away_.end(), [&](const departure& each) { return each.track == track; });
}

} // namespace okid_host
