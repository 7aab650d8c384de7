// SPDX-License-Identifier: MIT
#include "live_options.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/whole_file.hpp"
#include "live/playback.hpp"
#include "live/stream_memory.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>

namespace okid_host {
namespace {

std::optional<double> positive(const std::string& text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !(value > 0) || !std::isfinite(value))
        return std::nullopt;
    return value;
}

} // namespace

void add_output_options(CLI::App& command, live_arguments& given) {
    command.add_option("--duration", given.duration, "end after this much stream time")->type_name("SECONDS");
    command
        .add_option("--events", given.events, "write events as JSON lines to this file, - is stdout (then no table)")
        ->type_name("FILE.jsonl");
    command.add_option("--json", given.json, "write the final okid.result/1 to this file, - is stdout")
        ->type_name("FILE.json");
    command.add_flag("--quiet", given.quiet, "no modes and no table on stdout");
}

std::optional<double> parse_seconds(const char* option, const std::string& text) {
    if (text.empty()) return std::nullopt;
    const auto value = positive(text);
    if (!value || *value > 1e9)
        throw failure(exit_usage, fmt::format("{}: found \"{}\", expected seconds above 0", option, printable(text)));
    return value;
}

std::optional<std::int64_t> parse_stamp(const char* option, const std::string& text) {
    if (text.empty()) return std::nullopt;
    const auto value = positive(text);
    if (!value || *value > 9e9)
        throw failure(exit_usage, fmt::format("{}: found \"{}\", expected seconds as in a log, such as "
                                              "1764000000.123456",
                                              option, printable(text)));
    return std::llround(*value * 1e6) * 1000;
}

std::optional<double> parse_speed(const std::string& text) {
    if (text.empty() || text == "max") return std::nullopt;
    const auto value = positive(text);
    if (!value)
        throw failure(exit_usage, fmt::format("--speed: found \"{}\", expected max or a factor above 0 (1 = as it was)",
                                              printable(text)));
    return value;
}

bool plays_a_log(const live_config& config) {
    const auto replays = std::count_if(config.buses.begin(), config.buses.end(),
                                       [](const bus_config& bus) { return bus.type == "replay"; });
    if (replays == 0) return false;
    if (config.buses.size() != 1)
        throw failure(exit_usage,
                      fmt::format("{}: a bus of type replay beside another bus, expected it alone", config.path));
    require_edge_time(config, false);
    return true;
}

session_options check_live(const live_arguments& given, const live_config& config, const std::string& log) {
    require_identifiable(config);
    const stream_config stream = stream_of(config);
    require_memory(stream);
    session_options options;
    options.duration_s = parse_seconds("--duration", given.duration);
    options.events = given.events;
    options.json = given.json;
    options.table = !given.quiet;
    if (given.events == "-" && given.json == "-")
        throw failure(exit_usage, "--events - and --json - both want stdout, expected a file for one of them");
    if (!given.events.empty() && given.events == given.json && given.json != "-")
        throw failure(exit_usage, fmt::format("--events and --json name the same file \"{}\"", printable(given.json)));
    for (const std::string& target : {given.events, given.json}) {
        if (target.empty() || target == "-") continue;
        check_writable(target);
        check_other_file(target, config.path);
        check_other_file(target, log);
    }
    for (const auto& [code, text] : stream.said) say("okid: {}: {}\n", config.path, text);
    for (const std::string& text : config.warnings) say("okid: {}: {}\n", config.path, text);
    return options;
}

} // namespace okid_host
