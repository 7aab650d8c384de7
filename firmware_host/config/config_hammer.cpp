// SPDX-License-Identifier: MIT
#include "config_hammer.hpp"

#include "config_trigger.hpp"
#include "error.hpp"

#include <cstdlib>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double most_bytes = 1e9;

/// What else stands in the config must be able to go with separate hits.
void check_company(const config_place& place, const toml::table& table, const toml::table& file,
                   const live_config& config) {
    if (config.trigger.source != trigger_source::immediate)
        refuse_key({config.path, "[trigger]"}, file["trigger"].as_table()->get("source"), "source",
                   "[hammer] waits for hits itself: leave [trigger] out");
    if (config.identification.window_s || config.identification.forgetting)
        refuse_key({config.path, "[identification]"},
                   file["identification"].as_table()->get(config.identification.window_s ? "window_s" : "forgetting"),
                   config.identification.window_s ? "window_s" : "forgetting",
                   "the hits of a [hammer] test are averaged: leave it out");
    if (config.channels[config.hammer.channel].role != channel_role::force)
        refuse_key(place, table.get("channel"), "channel",
                   fmt::format("\"{}\" has not the role force", config.channels[config.hammer.channel].name));
    if (config.hammer.spectrum_hz > config.rate_hz / 2)
        refuse_key(place, table.get("spectrum_hz"), "spectrum_hz",
                   fmt::format("found {:g} Hz, expected at most half of rate_hz, {:g} Hz", config.hammer.spectrum_hz,
                               config.rate_hz / 2));
    const double bytes = (config.hammer.length_s + config.hammer.pretrigger_s) * config.rate_hz * 8 *
                         static_cast<double>(config.channels.size());
    if (bytes > most_bytes)
        refuse_key(place, table.get("length_s"), "length_s",
                   fmt::format("a hit of {:g} s would take {:.1f} GB, at most {:g} GB are kept", config.hammer.length_s,
                               bytes / 1e9, most_bytes / 1e9));
}

/// "points = [1, 2, -7]".
void read_points(const config_place& place, const toml::table& t, const live_config& config, hammer_config& out) {
    const toml::array* points = t["points"].as_array();
    if (!points) return;
    for (const toml::node& one : *points) {
        out.points.push_back(static_cast<int>(one.value<std::int64_t>().value_or(0)));
        if (out.points.back() == 0 || std::abs(one.value<std::int64_t>().value_or(0)) > 10000)
            refuse_key(place, points, "points",
                       "expected the numbers of the places in the order in which they are struck, "
                       "from 1 (-3: at 3, direction reversed), such as [1, 2, 7]");
    }
    if (points->empty()) refuse_key(place, points, "points", "is empty, expected a place at least");
    if (config.identification.method != "auto")
        refuse_key(
            place, points, "points",
            fmt::format("belongs to method \"auto\", {} takes all hits as one place", config.identification.method));
    if (config.n_u != 1)
        refuse_key(place, points, "points",
                   fmt::format("{} force channels, expected one, that of the "
                               "hammer",
                               config.n_u));
}

} // namespace

void read_hammer(const toml::table& file, live_config& config) {
    const toml::table* table = file["hammer"].as_table();
    if (!table) return;
    const config_place place{config.path, "[hammer]"};
    const toml::table& t = *table;
    hammer_config& out = config.hammer;
    out.enabled = true;
    out.channel = triggering_channel(place, t, config);
    if (!t.contains("level") || *t["level"].value<double>() == 0)
        throw failure(exit_usage,
                      fmt::format("{}: line {}, [hammer]: \"level\" {}: the force, in the channel's unit, with which a "
                                  "hit begins; negative for a hammer that reads negative",
                                  config.path, t.source().begin.line, t.contains("level") ? "is 0" : "is missing"));
    out.level = *t["level"].value<double>();
    out.hits = static_cast<int>(t["hits"].value_or(std::int64_t{out.hits}));
    out.length_s = t["length_s"].value_or(out.length_s);
    out.pretrigger_s = t["pretrigger_s"].value_or(out.pretrigger_s);
    out.double_percent = t["double_percent"].value_or(out.double_percent);
    out.spectrum_hz = t["spectrum_hz"].value_or(out.spectrum_hz);
    check_company(place, t, file, config);
    read_points(place, t, config, out);
}

} // namespace okid_host
