// SPDX-License-Identifier: MIT
#include "playback.hpp"

#include "acquire/frame_target.hpp"
#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "recording_link.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <drv/journal.h>
#include <drv/source.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <numeric>
#include <string_view>
#include <unistd.h>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t most_segments = 9999;

int stop_asked(void*) { return stop_requested(); }

/// Which bus of a config each bus of a journal feeds, -1 = none.
std::vector<int> map_journal(const std::string& path, const live_config& config) {
    const std::vector<journal_header::bus> there = read_journal_header(path).buses, wanted = journal_buses(config);
    std::vector<int> out(DRV_MAX_BUSES, -1);
    bool any = false;
    const auto feed = [&](std::size_t from, std::size_t to) {
        any = true;
        if (out[from] < 0) out[from] = static_cast<int>(to);
    };
    for (const bool by_name : {true, false})
        for (std::size_t i = 0; i < there.size(); ++i)
            for (std::size_t k = 0; k < wanted.size(); ++k)
                if (by_name ? there[i].name == wanted[k].name : there[i].interface == wanted[k].interface) feed(i, k);
    if (there.empty()) // its header is lost: by number
        for (std::size_t k = 0; k < wanted.size(); ++k) feed(k, k);
    if (!any && there.size() == 1 && wanted.size() == 1) feed(0, 0);
    if (any) return out;
    std::vector<std::string> names[2];
    for (const journal_header::bus& bus : there) names[0].push_back(bus.name);
    for (const journal_header::bus& bus : wanted) names[1].push_back(bus.name);
    throw failure(exit_usage, fmt::format("{}: found frames of the buses {}, expected a bus of {}: {}", path,
                                          list_names(names[0]), config.path, list_names(names[1])));
}

bool contains(const std::vector<std::string>& names, std::string_view name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

/// By name; a log with one interface feeds the only CAN bus.
std::vector<std::string> map_interfaces(const std::string& log, const live_config& config) {
    std::vector<std::string> wanted;
    for (const bus_config& bus : config.buses) wanted.push_back(bus.interface);
    std::vector<std::string> there = interfaces_of(log, wanted);
    if (there.empty() || contains(wanted, there.back())) return wanted; // an empty or malformed log names its own fault
    if (wanted.size() == 1 && there.size() == 1) return there;
    throw failure(exit_usage, fmt::format("{}: found frames of {}, expected an interface of {}: {}", log,
                                          list_names(there), config.path, list_names(wanted)));
}

} // namespace

std::vector<std::string> interfaces_of(const std::string& log, const std::vector<std::string>& enough) {
    std::vector<std::string> out;
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(log, ignored)) return out; // a pipe can be read only once
    std::ifstream input(log, std::ios::binary);
    std::string piece(std::size_t{1} << 16, '\0');
    for (std::size_t have = 0; input;) {
        input.read(piece.data() + have, static_cast<std::streamsize>(piece.size() - have));
        have += static_cast<std::size_t>(input.gcount());
        std::string_view rest(piece.data(), have);
        for (std::size_t end; (end = rest.find('\n')) != std::string_view::npos || (!input && !rest.empty());) {
            const std::string_view line = rest.substr(0, end);
            rest.remove_prefix(std::min(rest.size(), line.size() + 1));
            const std::size_t close = line.find(')');
            if (close == std::string_view::npos) continue;
            const std::size_t begin = line.find_first_not_of(" \t", close + 1);
            if (begin == std::string_view::npos) continue;
            const std::string_view name = line.substr(begin, line.find_first_of(" \t", begin) - begin);
            if (name.size() >= DRV_NAME_BYTES || (!out.empty() && out.back() == name) || contains(out, name)) continue;
            out.emplace_back(name);
            if (contains(enough, name)) return out;
        }
        have = rest.size() < piece.size() ? rest.size() : 0; // a line so long is no frame
        std::memmove(piece.data(), rest.data(), have);
    }
    return out;
}

bool is_journal(const std::string& path) { return std::filesystem::path(path).extension() == ".okj"; }

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

log_frames::log_frames(const std::string& path) : path_(path), batch_(512) { open({}); }

log_frames::log_frames(const std::string& path, const live_config& config) : path_(path), batch_(512) {
    if (is_journal(path)) bus_of_ = map_journal(path, config);
    open(is_journal(path) ? std::vector<std::string>{} : map_interfaces(path, config));
}

log_frames::log_frames(const std::string& path, const std::vector<std::string>& interfaces) : path_(path), batch_(512) {
    open(interfaces);
}

void log_frames::open(const std::vector<std::string>& interfaces) {
    source_.ops = is_journal(path_) ? &drv_source_journal : &drv_source_replay;
    drv_source_config_t config{};
    config.path = path_.c_str();
    for (std::size_t i = 0; i < interfaces.size() && i < DRV_MAX_BUSES; ++i)
        config.interfaces[i] = interfaces[i].c_str();
    config.interface_count = static_cast<std::int32_t>(std::min<std::size_t>(interfaces.size(), DRV_MAX_BUSES));
    if (source_.ops->open(&source_, &config) != 0) throw failure(exit_usage, source_.error);
    measure();
}

/// The sizes of a log, or of a journal and the segments behind it.
void log_frames::measure() {
    char next[4096];
    std::error_code fault;
    for (std::string path = path_; sizes_.size() < most_segments; path = next) {
        const auto bytes = std::filesystem::file_size(path, fault);
        if (fault) return;
        sizes_.push_back(static_cast<double>(bytes));
        if (!is_journal(path) || !drv_journal_next_name(path.c_str(), next, sizeof next)) return;
    }
}

double log_frames::share() const {
    const int fd = source_.ops->fd(&source_);
    const off_t at = fd < 0 ? -1 : lseek(fd, 0, SEEK_CUR);
    const double all = std::accumulate(sizes_.begin(), sizes_.end(), 0.0);
    if (at < 0 || !(all > 0)) return -1;
    const int file = is_journal(path_) ? drv_source_journal_segments(&source_) - 1 : 0;
    const auto behind =
        sizes_.begin() + std::clamp<std::ptrdiff_t>(file, 0, std::distance(sizes_.begin(), sizes_.end()));
    return std::min(1.0, std::accumulate(sizes_.begin(), behind, static_cast<double>(at)) / all);
}

log_frames::~log_frames() { source_.ops->close(&source_); }

/// What was left out, once, at the end.
void log_frames::tell_damage() {
    if (std::exchange(reported_, true)) return;
    drv_stats_t counts{};
    source_.ops->stats(&source_, &counts);
    const drv_journal_reader_t* reader = is_journal(path_) ? drv_source_journal_reader(&source_) : nullptr;
    if (!reader) {
        if (counts.torn) say("okid: warning: the last line of the log is torn (its writer was killed?): left out\n");
        return;
    }
    if (const int segments = drv_source_journal_segments(&source_); segments > 1)
        say("okid: {} and the {} segment{} behind it\n", path_, segments - 1, segments > 2 ? "s" : "");
    if (reader->missing + reader->damaged > 0)
        say("okid: warning: the journal is damaged in {} place{}: {} chunks are missing, {} bytes were left out; "
            "every whole chunk was taken, the gaps are marked\n",
            reader->damaged, reader->damaged == 1 ? "" : "s", reader->missing, reader->skipped_bytes);
    if (reader->foreign > 0)
        say("okid: warning: {} chunks belong to another recording or stand twice: left out\n", reader->foreign);
    if (counts.lost_driver > 0)
        say("okid: warning: {} frames were lost when this was recorded: the disk was too slow\n", counts.lost_driver);
    if (reader->more)
        say("okid: warning: the run went on, but the segment behind the last one read is not there: this is not all of "
            "it\n");
    if (!reader->ended)
        say("okid: warning: the journal was not closed (its writer was killed, or the disk was full): it "
            "ends with its last whole chunk{}\n",
            reader->torn_bytes ? fmt::format(", {} bytes behind it were left out", reader->torn_bytes) : "");
}

const drv_frame_t* log_frames::next() {
    for (;;) {
        if (at_ == count_) {
            count_ = source_.ops->read(&source_, batch_.data(), static_cast<int>(batch_.size()));
            at_ = 0;
            if (count_ < 0 && count_ != DRV_END) throw failure(exit_usage, source_.error);
            if (count_ <= 0) {
                tell_damage();
                count_ = 0;
                return nullptr;
            }
            if (on_share_) on_share_(share());
        }
        drv_frame_t& frame = batch_[static_cast<std::size_t>(at_++)];
        if (bus_of_.empty()) return &frame;
        const int bus = bus_of_[frame.bus];
        if (bus < 0) continue;
        frame.bus = static_cast<std::uint8_t>(bus);
        return &frame;
    }
}

void require_edge_time(const live_config& config, bool given) {
    if (config.trigger.source != trigger_source::gpio || given) return;
    throw failure(exit_usage, fmt::format("{}: [trigger] source = \"gpio\", but a log holds no edges. Say when it "
                                          "came: --trigger-at SECONDS (a time of the log; time_s in the trigger "
                                          "event of the live run), or give another source",
                                          config.path));
}

void play_through(const std::string& log, const live_config& config, stream_target& target, std::optional<double> speed,
                  const std::optional<recorder_options>& recording, const read_share& on_share) {
    log_frames frames(log, config);
    frames.on_share(on_share);
    recording_link recorded(config, recording);
    pacer pace(speed);
    while (const drv_frame_t* frame = frames.next()) {
        if (!pace.wait_for(frame->time_ns)) break;
        if (recorded.get()) recorded.get()->feed(*frame);
        target.frame(*frame);
        recorded.serve(target);
        if (target.done()) break;
    }
    recorded.finish(target);
}

void play_onto_bus(const std::string& log, const std::string& interface, std::optional<double> speed,
                   const read_share& on_share) {
    log_frames frames(log);
    frames.on_share(on_share);
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
