// SPDX-License-Identifier: MIT
#include "record_watch.hpp"

#include "acquire/host_time.hpp"
#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <numeric>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr double redraw_s = 0.5;
constexpr double patience_s = 2; // beyond the duration, when the channels do not come

} // namespace

record_watch::record_watch(const live_config& config, const std::optional<double>& duration_s)
    : config_(config), duration_s_(duration_s), grid_(config, *this), check_(config), trigger_(config),
      losses_(config.buses.size()) {
    if (duration_s || isatty(STDERR_FILENO) == 1) progress_.emplace(true);
    if (!duration_s) return;
    limit_ = std::max<std::int64_t>(1, std::llround(*duration_s * config.rate_hz));
    grid_.set_limit(limit_);
}

void record_watch::frame(const drv_frame_t& frame) {
    drv_frame_t stamped = frame;
    stamped.time_ns = frame.time_ns / 1000 * 1000; // as a session takes it
    if (first_ns_ == 0) first_ns_ = stamped.time_ns;
    last_ns_ = stamped.time_ns;
    ++frames_;
    check_.add(stamped);
    grid_.push(stamped);
    if (progress_ && frames_ % 64 == 0) show();
}

void record_watch::show() {
    const double now = steady_s();
    if (now - shown_at_ < redraw_s) return;
    shown_at_ = now;
    progress_->reword(fmt::format("{}, {} frames", trigger_.waiting() ? "armed" : "recording", frames_));
    if (duration_s_) progress_->share(static_cast<double>(last_ns_ - first_ns_) * 1e-9 / *duration_s_);
}

void record_watch::on_sample(std::int64_t index, const double* row) {
    if (trigger_.waiting()) (void)trigger_.add(index, row, 1, grid_.time_ns(index));
}

void record_watch::on_missing(std::int64_t index, std::int64_t count) {
    if (trigger_.waiting()) (void)trigger_.add(index, nullptr, count, 0);
}

void record_watch::trigger_edge(std::int64_t time_ns) {
    trigger_.edge(time_ns);
    (void)trigger_.look_back();
}

lamp_state record_watch::lamps() const {
    lamp_state out;
    out.armed = trigger_.waiting() || config_.trigger.source == trigger_source::immediate;
    return out;
}

void record_watch::record_event(const std::string& kind, const std::string&) { stopped_ |= kind == "stopped"; }

bool record_watch::done() const {
    if (stopped_) return true;
    if (!duration_s_) return false;
    return grid_.emitted() >= limit_ || static_cast<double>(last_ns_ - first_ns_) * 1e-9 > *duration_s_ + patience_s;
}

void record_watch::finish() {
    progress_.reset();
    if (stopped_) throw failure(exit_device, ""); // said when it happened
    if (!heard())
        throw failure(exit_no_model, fmt::format("no frame was received: are the sensors on, and are the buses of {} "
                                                 "the right ones?",
                                                 config_.path));
    if (trigger_.waiting()) throw failure(exit_no_model, trigger_.missed());
    grid_.finish();
    std::string report;
    for (std::size_t i = 0; i < config_.buses.size(); ++i) {
        const auto lost = grid_.bus(i).lost;
        const std::uint64_t missing = std::accumulate(lost.begin(), lost.end(), std::uint64_t{0});
        report += fmt::format(
            "bus {}: {} frames of the channels, {} missing ({} dropped by the socket, {} by the driver)\n",
            config_.buses[i].name, grid_.bus(i).received, missing, losses_[i].socket_overflow, losses_[i].driver);
    }
    for (std::size_t i = 0; i < config_.channels.size(); ++i) {
        const grid_channel_counts counts = grid_.channel(i);
        const double percent =
            counts.expected ? 100.0 * static_cast<double>(counts.received) / static_cast<double>(counts.expected) : 0;
        report += fmt::format("channel {}: {} of {} samples, {:.4g} %\n", config_.channels[i].name, counts.received,
                              counts.expected, percent);
    }
    (void)std::fwrite(report.data(), 1, report.size(), stdout);
    for (std::size_t i = 0; i < config_.buses.size(); ++i)
        if (const std::string unheard = check_.unheard(i), others = check_.others(i); !unheard.empty())
            say("okid: warning: bus {}: no frame of {}{}\n", config_.buses[i].name, unheard,
                others.empty() ? "" : "; it carries " + others);
    for (const auto& [code, text] : check_.doubts()) say("okid: warning: {}\n", text);
}

} // namespace okid_host
