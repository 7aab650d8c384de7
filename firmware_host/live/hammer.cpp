// SPDX-License-Identifier: MIT
#include "hammer.hpp"

#include "align/missing.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double pulse_share = 0.1; // of the peak: what belongs to a pulse
constexpr double least_peak = 20;   // in deviations of the force before the hit
constexpr double most_motion = 0.1; // rms before the hit, of that after it
constexpr double band_share = 0.1;  // of the greatest amplitude: -20 dB
constexpr std::size_t frequencies = 128;
constexpr std::size_t flat_top = 5; // samples that are exactly equal at the peak: an amplifier at its limit

} // namespace

hammer::hammer(const live_config& config, std::int64_t lags)
    : wanted_(config.hammer), channels_(config.channels), rate_hz_(config.rate_hz), width_(config.channels.size()),
      identified_(config.n_u + config.n_y), left_(config.hammer.total()) {
    if (!wanted_.enabled) return;
    const channel_config& channel = config.channels[wanted_.channel];
    unit_ = channel.unit.empty() ? "" : " " + channel.unit;
    scale_ = channel.layout.scale;
    offset_ = channel.layout.offset;
    before_ = std::max<std::int64_t>(std::llround(wanted_.pretrigger_s * rate_hz_), lags + lags / 8 + 4);
    after_ = std::max<std::int64_t>(std::llround(wanted_.length_s * rate_hz_), 16);
    rows_.assign(rows() * width_, missing_sample);
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
    const double now = row ? offset_ + scale_ * row[wanted_.channel] : missing_sample;
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

bool hammer::refuse(const char* fault, std::string text) {
    report_.fault = fault;
    report_.text = std::move(text);
    return true;
}

/// A sample that is missing in the middle of a hit cannot be asked for again, but the hit can.
bool hammer::find_missing() {
    std::size_t lost = 0;
    for (std::size_t i = 0; i < rows(); ++i)
        lost += std::any_of(at(i), at(i) + identified_, [](double x) { return std::isnan(x); });
    return lost > 0 && refuse("samples_lost", fmt::format("{} of {} samples are missing", lost, rows()));
}

bool hammer::find_overload() {
    for (std::size_t c = 0; c < identified_; ++c) {
        const drv_signal_t& layout = channels_[c].layout;
        if (layout.value != DRV_VALUE_INTEGER || layout.length > 32) continue;
        const double high = std::ldexp(1.0, layout.length - (layout.is_signed ? 1 : 0)) - 1;
        const double low = layout.is_signed ? -high - 1 : -1; // 0 of an unsigned code is no limit
        std::size_t full = 0;
        for (std::size_t i = 0; i < rows(); ++i) full += at(i)[c] >= high || at(i)[c] <= low;
        if (full > 0)
            return refuse("overload",
                          fmt::format("{} stood at full scale for {} sample{}: strike softer or lower its gain",
                                      channels_[c].name, full, full == 1 ? "" : "s"));
    }
    std::size_t equal = 0;
    for (std::size_t i = begin_; i < end_; ++i) equal += force(i) == force(top_);
    return equal >= flat_top &&
           refuse("overload",
                  fmt::format("the force has a flat top of {} samples at {:.4g}{}: its amplifier was at its "
                              "limit",
                              equal, force(top_), unit_));
}

/// Peak and extent of the hit, and the noise of the force before it.
void hammer::measure() {
    const auto quiet = static_cast<std::size_t>(before_) * 7 / 8;
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < quiet; ++i) sum += force(i);
    base_ = sum / static_cast<double>(quiet);
    for (std::size_t i = 0; i < quiet; ++i) squares += (force(i) - base_) * (force(i) - base_);
    noise_ = std::sqrt(squares / static_cast<double>(quiet));
    const double sign = wanted_.level > 0 ? 1 : -1;
    top_ = static_cast<std::size_t>(before_);
    for (std::size_t i = top_; i < rows(); ++i)
        if (sign * force(i) > sign * force(top_)) top_ = i;
    report_.peak = force(top_) - base_;
    const auto inside = [&](std::size_t i) { return (force(i) - base_) / report_.peak > pulse_share; };
    begin_ = top_;
    end_ = top_ + 1;
    while (begin_ > 0 && inside(begin_ - 1)) --begin_;
    while (end_ < rows() && inside(end_)) ++end_;
    report_.duration_s = static_cast<double>(end_ - begin_) / rate_hz_;
}

bool hammer::find_second_blow() {
    const double share = wanted_.double_percent / 100;
    const std::size_t apart = std::max<std::size_t>(3, (end_ - begin_) / 2);
    const auto struck = [&](std::size_t i) { return (force(i) - base_) / report_.peak > share; };
    for (std::size_t i = static_cast<std::size_t>(before_) * 7 / 8; i < rows(); ++i) {
        if (i + apart >= begin_ && i < end_ + apart) continue;
        if (struck(i))
            return refuse("double_hit",
                          fmt::format("a second hit of {:.0f} % {:.1f} ms {}", 100 * (force(i) - base_) / report_.peak,
                                      1e3 * std::abs(static_cast<double>(i) - static_cast<double>(top_)) / rate_hz_,
                                      i > top_ ? "later" : "earlier"));
    }
    return false;
}

/// Is the structure still ringing from what was before? The rms before the hit against that behind it.
bool hammer::find_motion() {
    const auto count = static_cast<std::size_t>(before_);
    const auto rms = [&](std::size_t c, std::size_t first, std::size_t last) {
        double sum = 0, squares = 0;
        for (std::size_t i = first; i < last; ++i) sum += at(i)[c], squares += at(i)[c] * at(i)[c];
        const double n = static_cast<double>(last - first), mean = sum / n;
        return std::sqrt(std::max(0.0, squares / n - mean * mean));
    };
    std::size_t forces = 0;
    while (forces < identified_ && channels_[forces].role == channel_role::force) ++forces;
    for (std::size_t c = forces; c < identified_; ++c) {
        const double was = rms(c, 0, count * 7 / 8), is = rms(c, count, std::min(rows(), 2 * count));
        if (was > most_motion * is)
            return refuse("moving",
                          fmt::format("{} still moved before the hit, by {:.0f} % of what the hit caused (rms): "
                                      "wait longer, or strike harder",
                                      channels_[c].name, 100 * was / is));
    }
    return false;
}

/// Where the spectrum of the pulse has fallen to a tenth of its greatest amplitude.
void hammer::find_band() {
    const std::size_t margin = 2 + (end_ - begin_) / 2;
    const std::size_t first = begin_ > margin ? begin_ - margin : 0, last = std::min(rows(), end_ + margin);
    double greatest = 0;
    report_.band_hz = rate_hz_ / 2;
    for (std::size_t k = 0; k <= frequencies; ++k) {
        const double f = static_cast<double>(k) / (2.0 * frequencies); // of the rate
        std::complex<double> sum = 0;
        for (std::size_t i = first; i < last; ++i)
            sum +=
                (force(i) - base_) * std::polar(1.0, -2 * 3.14159265358979323846 * f * static_cast<double>(i - first));
        greatest = std::max(greatest, std::abs(sum));
        if (std::abs(sum) >= band_share * greatest) continue;
        report_.band_hz = f * rate_hz_;
        return;
    }
}

void hammer::judge() {
    const auto weak = [&] {
        return !(std::abs(report_.peak) > least_peak * noise_) &&
               refuse("weak", fmt::format("a peak of {:.4g}{} is only {:.1f} times the noise of the force",
                                          report_.peak, unit_, std::abs(report_.peak) / noise_));
    };
    const auto narrow = [&] {
        return report_.band_hz < wanted_.spectrum_hz &&
               refuse("spectrum", fmt::format("the force reaches to {:.4g} Hz only (-20 dB), wanted {:.4g} Hz: take a "
                                              "harder tip",
                                              report_.band_hz, wanted_.spectrum_hz));
    };
    const bool bad =
        (early_ && refuse("too_early", fmt::format("it came before {:.2f} s of quiet were recorded: wait for the lamp",
                                                   static_cast<double>(before_) / rate_hz_))) ||
        find_missing();
    if (!bad) {
        measure();
        find_band();
        (void)(find_overload() || weak() || find_second_blow() || find_motion() || narrow());
    }
    if (report_.good()) {
        ++accepted_;
        --left_;
        report_.text = fmt::format("accepted: {:.4g}{}, {:.2f} ms, force up to {:.4g} Hz", report_.peak, unit_,
                                   1e3 * report_.duration_s, report_.band_hz);
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
                       armed() ? fmt::format("strike{} ({} beyond {:.4g}{})", at, channels_[wanted_.channel].name,
                                             wanted_.level, unit_)
                       : point ? fmt::format("wait, next{}", at)
                               : "wait",
                       point ? fmt::format("{} of {} there, ", there, wanted_.hits) : "", left_, wanted_.total());
}

std::string hammer::shortfall() const {
    if (!wanted() || left_ == 0) return "";
    if (heard_ == 0)
        return fmt::format("no hit was detected: {} stayed between {:.4g} and {:.4g}{}, level is {:.4g}",
                           channels_[wanted_.channel].name, least_, most_, unit_, wanted_.level);
    std::string why;
    for (const auto& [fault, count] : refused_) why += fmt::format("{}{} {}", why.empty() ? ": " : ", ", count, fault);
    const int refused = heard_ - accepted_ - (capturing_ ? 1 : 0);
    return fmt::format("{}: {} rejected{}{}",
                       accepted_ == 0 ? fmt::format("no hit was accepted ({} wanted)", wanted_.total())
                                      : fmt::format("{} of {} hits were accepted", accepted_, wanted_.total()),
                       refused, why, capturing_ ? "; the last one was cut off by the end" : "");
}

} // namespace okid_host
