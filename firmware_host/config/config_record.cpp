// SPDX-License-Identifier: MIT
#include "config_record.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double least_segment_mb = 0.2; // a segment holds several chunks
constexpr double most_waiting_bytes = 1e9;
constexpr double delay_s = 5; // a trigger is found at most this long after its frames
constexpr double shortest_frame_bits = 47;

/// Frames a second that a bus can bring: all of it where the kernel leaves nothing out, else those the config asks for.
double frames_per_s(const live_config& config, std::size_t bus) {
    constexpr double margin = 1.5, least = 1000;
    if (const auto& bitrate = config.buses[bus].bitrate) return *bitrate / shortest_frame_bits;
    return std::max(least, margin * config.rate_hz * static_cast<double>(wanted_frames(config, bus).size()));
}

} // namespace

void read_record(const toml::table& file, live_config& config) {
    const toml::table* table = file["record"].as_table();
    const toml::table none;
    const toml::table& t = table ? *table : none;
    const config_place place{config.path, "[record]"};
    record_config& out = config.record;
    out.wanted = table != nullptr;
    const std::filesystem::path directory(t["directory"].value_or(out.directory));
    out.directory = (std::filesystem::path(config.path).parent_path() / directory).string();
    out.segment_mb = t["segment_mb"].value_or(out.segment_mb);
    out.max_mb = t["max_mb"].value_or(std::max(out.max_mb, 2 * out.segment_mb));
    if (out.segment_mb < least_segment_mb)
        refuse_key(place, t.get("segment_mb"), "segment_mb",
                   fmt::format("found {:g}, expected at least {:g}", out.segment_mb, least_segment_mb));
    if (out.max_mb < 2 * out.segment_mb)
        refuse_key(place, t.get("max_mb"), "max_mb",
                   fmt::format("found {:g}, expected room for two segments, {:g}", out.max_mb, 2 * out.segment_mb));
    const bool waits = config.trigger.source != trigger_source::immediate;
    if (waits) out.pretrigger_s = std::max(out.pretrigger_s, config.trigger.pretrigger_s + 1);
    if (const toml::node* node = t.get("pretrigger_s")) {
        out.pretrigger_s = *node->value<double>();
        if (waits && out.pretrigger_s < config.trigger.pretrigger_s)
            config.warnings.push_back(
                fmt::format("[record] pretrigger_s = {:g} is less than that of [trigger], {:g}: a "
                            "replay has fewer samples than the run",
                            out.pretrigger_s, config.trigger.pretrigger_s));
    }
    if (!waits) return;
    double frames = 0;
    for (std::size_t i = 0; i < config.buses.size(); ++i)
        frames += frames_per_s(config, i) * (out.pretrigger_s + delay_s);
    const double most = most_waiting_bytes / sizeof(drv_frame_t);
    if (frames > most && out.wanted)
        throw failure(exit_usage, fmt::format("{}: [record] pretrigger_s: {:g} s of these buses are up to {:.1f} GB of "
                                              "frames, at most {:g} GB are kept; shorten it",
                                              config.path, out.pretrigger_s, frames / most * most_waiting_bytes / 1e9,
                                              most_waiting_bytes / 1e9));
    out.pretrigger_frames = static_cast<std::size_t>(std::ceil(std::min(frames, most)));
}

} // namespace okid_host
