// SPDX-License-Identifier: MIT
#include "playback.hpp"

#include "../error.hpp"
#include "../nearest_name.hpp"
#include "reader.hpp"
#include "stop_signal.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <drv/sink.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <utility>

namespace okid_host {
namespace {

constexpr std::int64_t second_ns = 1000000000;

std::int64_t monotonic_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return std::int64_t{now.tv_sec} * second_ns + now.tv_nsec;
}

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
    if (stop_requested()) return false;
    if (!speed_) return true;
    if (begin_ns_ < 0) {
        first_ns_ = time_ns;
        begin_ns_ = monotonic_ns();
    }
    const std::int64_t due = begin_ns_ + static_cast<std::int64_t>(static_cast<double>(time_ns - first_ns_) / *speed_);
    while (due > monotonic_ns()) { // in short pieces, so that a signal is not missed
        const std::int64_t piece = std::min(due, monotonic_ns() + second_ns / 10);
        const timespec until{static_cast<std::time_t>(piece / second_ns), static_cast<long>(piece % second_ns)};
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
        if (stop_requested()) return false;
    }
    return true;
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
    drv_sink_t sink{};
    const int code = drv_sink_open(&sink, interface.c_str());
    if (code != 0) throw_interface_failure(-code, interface, sink.error);
    catch_stop_signals();
    pacer pace(speed);
    int status = 0;
    while (const drv_frame_t* frame = frames.next()) {
        if (!pace.wait_for(frame->time_ns)) break;
        if ((status = drv_sink_write(&sink, frame, 2000)) != 0) break;
    }
    drv_sink_close(&sink);
    if (status != 0) throw failure(exit_device, fmt::format("interface {}: {}", interface, sink.error));
    if (stop_requested()) throw failure(exit_interrupted, fmt::format("interrupted after {} frames", sink.sent));
    fmt::print("{} frames played onto {}\n", sink.sent, interface);
}

} // namespace okid_host
