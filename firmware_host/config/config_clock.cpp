// SPDX-License-Identifier: MIT
#include "config_clock.hpp"

#include "config_schema.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double fastest_ratio = 64; // samples of a node for one of the grid

void read_bus_clock(const config_place& place, const toml::table& table, double grid_hz, bus_config& bus) {
    bus.free_clock = table["clock"].value_or(std::string("shared")) == "free";
    bus.rate_hz = table["rate_hz"].value<double>();
    if (!bus.rate_hz) return;
    if (!bus.free_clock)
        refuse_key(place, table.get("rate_hz"), "rate_hz",
                   "nodes that share one clock all have the rate of [acquisition]: rate_hz goes with clock = \"free\"");
    if (*bus.rate_hz > fastest_ratio * grid_hz || *bus.rate_hz < grid_hz / fastest_ratio)
        refuse_key(place, table.get("rate_hz"), "rate_hz",
                   fmt::format("found {:g} Hz, expected {:g} to {:g} Hz beside a grid of {:g} Hz", *bus.rate_hz,
                               grid_hz / fastest_ratio, fastest_ratio * grid_hz, grid_hz));
}

/// Without counted channels the first channel's node is the reference: the grid is its samples.
void check_reference(const config_place& place, const toml::table& table, double grid_hz, const live_config& config) {
    const std::size_t first = clock_domains(config).front().front();
    const bus_config& bus = config.buses[config.channels[first].bus];
    if (!bus.free_clock || !bus.rate_hz || std::abs(*bus.rate_hz / grid_hz - 1) < 1e-9) return;
    refuse_key(place, table.get("rate_hz"), "rate_hz",
               fmt::format("found {:g} Hz, expected {:g} Hz: every node has a clock of its own, so the first channel's "
                           "(\"{}\") is the reference, and its rate is rate_hz x decimate of [acquisition]",
                           *bus.rate_hz, grid_hz, config.channels[first].name));
}

/// Do two channels come in the same frames?
bool together(const channel_config& a, const channel_config& b) {
    return a.bus == b.bus && a.frame.id == b.frame.id && a.frame.extended == b.frame.extended &&
           a.frame.mask == b.frame.mask;
}

} // namespace

std::vector<std::vector<std::size_t>> clock_domains(const live_config& config) {
    std::vector<std::vector<std::size_t>> out(1); // the counted channels first
    for (std::size_t c = 0; c < config.channels.size(); ++c) {
        const channel_config& channel = config.channels[c];
        if (!config.buses[channel.bus].free_clock) {
            out.front().push_back(c);
            continue;
        }
        const auto same = std::find_if(out.begin() + 1, out.end(), [&](const std::vector<std::size_t>& node) {
            return together(config.channels[node.front()], channel);
        });
        if (same != out.end())
            same->push_back(c);
        else
            out.push_back({c});
    }
    if (out.front().empty()) out.erase(out.begin());
    return out;
}

void read_clocks(const toml::table& file, live_config& config) {
    config.decimate = static_cast<int>(file["acquisition"]["decimate"].value_or(std::int64_t{1}));
    const double grid_hz = config.rate_hz * config.decimate;
    const toml::array& buses = *file["bus"].as_array();
    for (std::size_t i = 0; i < config.buses.size(); ++i) {
        const toml::table& table = *buses.get_as<toml::table>(i);
        read_bus_clock({config.path, entry_name("bus", table, i)}, table, grid_hz, config.buses[i]);
    }
    const std::size_t reference = config.channels[clock_domains(config).front().front()].bus;
    const toml::table& table = *buses.get_as<toml::table>(reference);
    check_reference({config.path, entry_name("bus", table, reference)}, table, grid_hz, config);
}

bool resampled(const live_config& config) { return config.decimate > 1 || clock_domains(config).size() > 1; }

} // namespace okid_host
