// SPDX-License-Identifier: MIT
#include "playback.hpp"

#include "../error.hpp"
#include "../nearest_name.hpp"
#include "frame_target.hpp"
#include "stop_signal.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <utility>

namespace okid_host {
namespace {

int stop_asked(void*) { return stop_requested(); }

/// Second word of every line, each once, in order of appearance.
std::vector<std::string> interfaces_of(const std::string& log) {
    std::vector<std::string> out;
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(log, ignored)) return out; // a pipe can be read only once
    std::ifstream input(log);
    std::string line;
    while (std::getline(input, line)) {
        const std::size_t close = line.find(')'),
                          begin = line.find_first_not_of(" \t", close == std::string::npos ? close : close + 1);
        if (close == std::string::npos || begin == std::string::npos) continue;
        const std::string name = line.substr(begin, line.find_first_of(" \t", begin) - begin);
        if (name.size() < DRV_NAME_BYTES && (out.empty() || out.back() != name) &&
            std::find(out.begin(), out.end(), name) == out.end())
            out.push_back(name);
    }
    return out;
}

} // namespace

bool pacer::wait_for(std::int64_t time_ns) {
    if (!speed_) return !stop_requested();
    if (!begun_) {
        begun_ = true;
        first_ns_ = time_ns;
        drv_pacer_start(&timing_, 0);
    }
    const double offset_ns = static_cast<double>(time_ns - first_ns_) / *speed_;
    constexpr double never_ns = 4e18;
    return drv_pacer_wait(&timing_, std::llround(std::min(offset_ns, never_ns)), stop_asked, nullptr) != 0;
}

std::vector<std::string> map_interfaces(const std::string& log, const live_config& config) {
    std::vector<std::string> wanted;
    for (const bus_config& bus : config.buses) wanted.push_back(bus.interface);
    std::vector<std::string> there = interfaces_of(log);
    const bool any = std::any_of(wanted.begin(), wanted.end(), [&](const std::string& name) {
        return std::find(there.begin(), there.end(), name) != there.end();
    });
    if (any || there.empty()) return wanted; // an empty or malformed log names its own fault
    if (wanted.size() == 1 && there.size() == 1) return there;
    throw failure(exit_usage, fmt::format("{}: found frames of {}, expected an interface of {}: {}", log,
                                          list_names(there), config.path, list_names(wanted)));
}

log_frames::log_frames(const std::string& path, const std::vector<std::string>& interfaces) : batch_(512) {
    source_.ops = &drv_source_replay;
    drv_source_config_t config{};
    config.path = path.c_str();
    for (std::size_t i = 0; i < interfaces.size() && i < DRV_MAX_BUSES; ++i)
        config.interfaces[i] = interfaces[i].c_str();
    config.interface_count = static_cast<std::int32_t>(std::min<std::size_t>(interfaces.size(), DRV_MAX_BUSES));
    if (source_.ops->open(&source_, &config) != 0) throw failure(exit_usage, source_.error);
}

log_frames::~log_frames() { source_.ops->close(&source_); }

const drv_frame_t* log_frames::next() {
    if (at_ == count_) {
        count_ = source_.ops->read(&source_, batch_.data(), static_cast<int>(batch_.size()));
        at_ = 0;
        if (count_ < 0 && count_ != DRV_END) throw failure(exit_usage, source_.error);
        if (count_ <= 0) {
            drv_stats_t counts{};
            source_.ops->stats(&source_, &counts);
            if (counts.torn && !std::exchange(told_torn_, true))
                fmt::print(stderr,
                           "okid: warning: the last line of the log is torn (its writer was killed?): left out\n");
            count_ = 0;
            return nullptr;
        }
    }
    return &batch_[static_cast<std::size_t>(at_++)];
}

void play_through_session(const std::string& log, const live_config& config, const session_options& options,
                          std::optional<double> speed) {
    if (config.trigger.source == trigger_source::gpio && !options.trigger_ns)
        throw failure(exit_usage, fmt::format("{}: [trigger] source = \"gpio\", but a log holds no edges. Say when it "
                                              "came: --trigger-at SECONDS (a time of the log; time_s in the trigger "
                                              "event of the live run), or give another source",
                                              config.path));
    log_frames frames(log, map_interfaces(log, config));
    catch_stop_signals();
    session played(config, options);
    pacer pace(speed);
    while (const drv_frame_t* frame = frames.next()) {
        if (!pace.wait_for(frame->time_ns)) break;
        played.frame(*frame);
        if (played.done()) break;
    }
    played.finish();
}

void play_onto_bus(const std::string& log, const std::string& interface, std::optional<double> speed) {
    log_frames frames(log, {});
    frame_target sink(interface);
    catch_stop_signals();
    pacer pace(speed);
    while (const drv_frame_t* frame = frames.next()) {
        if (!pace.wait_for(frame->time_ns)) break;
        sink.write(*frame);
    }
    if (stop_requested()) throw failure(exit_interrupted, fmt::format("interrupted after {} frames", sink.sent()));
    const drv_pacer_t& late = pace.lateness();
    fmt::print("{} frames played onto {}{}\n", sink.sent(), interface,
               speed ? fmt::format("; late by {:.0f} us (mean), {:.0f} us (sd), {:.0f} us (worst)", late.mean_ns / 1e3,
                                   drv_pacer_deviation(&late) / 1e3, static_cast<double>(late.worst_ns) / 1e3)
                     : "");
}

} // namespace okid_host
