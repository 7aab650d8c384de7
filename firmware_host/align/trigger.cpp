// SPDX-License-Identifier: MIT
#include "trigger.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double edge_delay_s = 1; // an edge is reported at most this long after the frames that follow it

} // namespace

trigger::trigger(const live_config& config)
    : wanted_(config.trigger), width_(config.channels.size()),
      pretrigger_(std::llround(config.trigger.pretrigger_s * config.rate_hz)),
      waiting_(config.trigger.source != trigger_source::immediate) {
    if (!waiting_) return;
    const double delay_s = wanted_.source == trigger_source::gpio ? edge_delay_s : 0;
    entries_.resize(static_cast<std::size_t>(pretrigger_ + std::llround(delay_s * config.rate_hz) + 1));
    rows_.resize(entries_.size() * width_);
    const channel_config& channel = config.channels[wanted_.channel];
    channel_ = channel.name;
    unit_ = channel.unit;
    scale_ = channel.layout.scale;
    offset_ = channel.layout.offset;
}

void trigger::edge(std::int64_t time_ns) {
    if (waiting_ && !edge_ns_) edge_ns_ = time_ns / 1000 * 1000; // at microseconds, as frames
}

void trigger::keep(std::int64_t index, const double* row, std::int64_t count, std::int64_t time_ns) {
    if (used_ == entries_.size())
        first_ = (first_ + 1) % entries_.size();
    else
        ++used_;
    const std::size_t at = (first_ + used_ - 1) % entries_.size();
    entries_[at] = {index, count, time_ns, row == nullptr};
    if (row) std::copy_n(row, width_, rows_.begin() + static_cast<std::ptrdiff_t>(at * width_));
}

bool trigger::come(std::int64_t sample, std::int64_t time_ns) {
    waiting_ = false;
    sample_ = sample;
    time_ns_ = time_ns;
    return true;
}

bool trigger::crosses(const double* row) {
    const double now = offset_ + scale_ * row[wanted_.channel];
    if (std::isnan(now)) return false;
    const bool first = !before_;
    const double before = before_.value_or(now);
    before_ = now;
    least_ = first ? now : std::min(least_, now);
    most_ = first ? now : std::max(most_, now);
    const bool up = before < wanted_.level && now >= wanted_.level,
               down = before > wanted_.level && now <= wanted_.level;
    return ((wanted_.edge & DRV_GPIO_RISING) && up) || ((wanted_.edge & DRV_GPIO_FALLING) && down);
}

bool trigger::add(std::int64_t index, const double* row, std::int64_t count, std::int64_t time_ns) {
    keep(index, row, count, time_ns);
    if (!row) return false;
    if (wanted_.source == trigger_source::level) return crosses(row) && come(index, time_ns);
    return edge_ns_ && time_ns >= *edge_ns_ && come(index, *edge_ns_);
}

bool trigger::look_back() {
    for (std::size_t k = 0; waiting_ && edge_ns_ && k < used_; ++k) {
        const entry& one = entries_[(first_ + k) % entries_.size()];
        if (!one.missing && one.time_ns >= *edge_ns_) return come(one.index, *edge_ns_);
    }
    return false;
}

std::string trigger::awaited() const {
    if (wanted_.source == trigger_source::gpio) return fmt::format("an edge of {}", wanted_.place.text());
    return fmt::format("{} {} {:g}{}{}", channel_,
                       wanted_.edge == DRV_GPIO_BOTH     ? "to cross"
                       : wanted_.edge == DRV_GPIO_RISING ? "to rise to"
                                                         : "to fall to",
                       wanted_.level, unit_.empty() ? "" : " ", unit_);
}

std::string trigger::missed() const {
    const std::string what = "the trigger never came: waited for " + awaited() + ", ";
    if (wanted_.source == trigger_source::level)
        return what + (before_ ? fmt::format("its values lay between {:g} and {:g}", least_, most_)
                               : std::string("but the channel had no sample"));
    return what + (edge_ns_ ? "which came after the last sample" : "but none came; is the line the right one?");
}

} // namespace okid_host
