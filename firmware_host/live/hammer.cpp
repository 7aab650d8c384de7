// SPDX-License-Identifier: MIT
#include "hammer.hpp"

#include "align/missing.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {

hammer::hammer(const live_config& config, std::int64_t lags)
    : wanted_(config.hammer), channel_(wanted_.enabled ? config.channels[wanted_.channel].name : ""),
      rate_hz_(config.rate_hz), width_(config.channels.size()), left_(config.hammer.total()) {
    if (!wanted_.enabled) return;
    const channel_config& channel = config.channels[wanted_.channel];
    window_.unit = channel.unit.empty() ? "" : " " + channel.unit;
    window_.scale = channel.layout.scale;
    window_.offset = channel.layout.offset;
    before_ = std::max<std::int64_t>(std::llround(wanted_.pretrigger_s * rate_hz_), lags + lags / 8 + 4);
    after_ = std::max<std::int64_t>(std::llround(wanted_.length_s * rate_hz_), 16);
    rows_.assign(rows() * width_, missing_sample);
    for (std::size_t c = 0; c < config.n_u + config.n_y; ++c) {
        const drv_signal_t& layout = config.channels[c].layout;
        hit_channel& one = judged_.emplace_back();
        one.name = config.channels[c].name;
        one.force = config.channels[c].role == channel_role::force;
        one.unit = config.channels[c].unit;
        one.scale = std::abs(layout.scale);
        if (layout.value != DRV_VALUE_INTEGER || layout.length > 32) continue;
        one.high = std::ldexp(1.0, layout.length - (layout.is_signed ? 1 : 0)) - 1;
        one.low = layout.is_signed ? -one.high - 1 : -1; // 0 of an unsigned code is no limit
    }
    window_.count = rows();
    window_.width = width_;
    window_.before = static_cast<std::size_t>(before_);
    window_.fewest_before = 0;
    window_.rate_hz = rate_hz_;
    window_.hammer = wanted_.channel;
    window_.sign = wanted_.level > 0 ? 1 : -1;
    window_.double_percent = wanted_.double_percent;
    window_.spectrum_hz = wanted_.spectrum_hz;
}

void hammer::keep(const double* row) {
    double* to = rows_.data() + static_cast<std::size_t>(next_) * width_;
    if (row)
        std::copy_n(row, width_, to);
    else
        std::fill_n(to, width_, missing_sample);
    next_ = (next_ + 1) % static_cast<std::int64_t>(rows());
}

bool hammer::crosses(const double* row) {
    const double now = row ? window_.offset + window_.scale * row[wanted_.channel] : missing_sample;
    if (std::isnan(now)) return false;
    const bool up = wanted_.level > 0, before = have_last_ && (up ? last_ < wanted_.level : last_ > wanted_.level);
    last_ = now;
    least_ = have_last_ ? std::min(least_, now) : now;
    most_ = have_last_ ? std::max(most_, now) : now;
    have_last_ = true;
    return before && (up ? now >= wanted_.level : now <= wanted_.level);
}

bool hammer::add(std::int64_t index, const double* row, std::int64_t count) {
    for (std::int64_t i = 0; i < count && left_ > 0; ++i) {
        const bool crossed = crosses(row);
        if (crossed && !capturing_) {
            capturing_ = true;
            early_ = kept_ < before_;
            to_come_ = after_;
            report_ = hit_report{};
            report_.number = ++heard_;
            report_.point = next_point();
            report_.sample = index + i;
        }
        keep(row);
        if (!capturing_) {
            kept_ = std::min(kept_ + 1, before_);
            continue;
        }
        if (--to_come_ > 0) continue;
        capturing_ = false;
        kept_ = 0;
        judge();
        return true; // a run of missing samples ends no capture before its length: nothing more of it is of use
    }
    return false;
}

void hammer::judge() {
    std::rotate(rows_.begin(), rows_.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(next_) * width_),
                rows_.end());
    next_ = 0;
    window_.rows = rows_.data();
    window_.channels = &judged_;
    if (early_) {
        report_.fault = "too_early";
        report_.text = fmt::format("it came before {:.2f} s of quiet were recorded: wait for the lamp",
                                   static_cast<double>(before_) / rate_hz_);
    } else {
        static_cast<hit_verdict&>(report_) = judge_hit(window_);
    }
    if (report_.good()) {
        ++accepted_;
        --left_;
    } else {
        const auto known =
            std::find_if(refused_.begin(), refused_.end(), [&](const auto& one) { return one.first == report_.fault; });
        if (known != refused_.end())
            ++known->second;
        else
            refused_.emplace_back(report_.fault, 1);
    }
    report_.accepted = accepted_;
    report_.left = left_;
}

std::string hammer::awaited() const {
    if (done()) return "all hits are there";
    if (capturing_) return fmt::format("hit {}: recording", heard_);
    const std::string last = report_.number == 0 ? std::string()
                             : report_.good()    ? fmt::format("hit {} {}; ", report_.number, report_.text)
                                                 : fmt::format("hit {} rejected, {}; ", report_.number, report_.text);
    const int point = next_point(), there = left_ - (left_ - 1) / wanted_.hits * wanted_.hits;
    const std::string at = point == 0 ? "" : fmt::format(" point {}", point);
    return fmt::format("{}{}, {}{} of {} left", last,
                       armed() ? fmt::format("strike{} ({} beyond {:.4g}{})", at, channel_, wanted_.level, window_.unit)
                       : point ? fmt::format("wait, next{}", at)
                               : "wait",
                       point ? fmt::format("{} of {} there, ", there, wanted_.hits) : "", left_, wanted_.total());
}

std::string hammer::shortfall() const {
    if (!wanted() || left_ == 0) return "";
    if (heard_ == 0)
        return fmt::format("no hit was detected: {} stayed between {:.4g} and {:.4g}{}, level is {:.4g}", channel_,
                           least_, most_, window_.unit, wanted_.level);
    std::string why;
    for (const auto& [fault, count] : refused_) why += fmt::format("{}{} {}", why.empty() ? ": " : ", ", count, fault);
    const int refused = heard_ - accepted_ - (capturing_ ? 1 : 0);
    return fmt::format("{}: {} rejected{}{}",
                       accepted_ == 0 ? fmt::format("no hit was accepted ({} wanted)", wanted_.total())
                                      : fmt::format("{} of {} hits were accepted", accepted_, wanted_.total()),
                       refused, why, capturing_ ? "; the last one was cut off by the end" : "");
}

} // namespace okid_host
