// SPDX-License-Identifier: MIT
// okid run: acquire, identify and show while it happens.
#include "../error.hpp"
#include "../live/capture.hpp"
#include "../live/playback.hpp"
#include "../live/session.hpp"
#include "../live/stop_signal.hpp"
#include "commands.hpp"
#include "live_options.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <memory>

namespace okid_host {
namespace {

void run(const live_arguments& given) {
    const live_config config = load_config(given.config);
    session_options options = check_live(given, config);
    std::optional<recorder_options> recording;
    if (config.record.wanted) recording = recorder_options{options.duration_s};
    const auto replays = std::count_if(config.buses.begin(), config.buses.end(),
                                       [](const bus_config& bus) { return bus.type == "replay"; });
    if (replays > 0 && config.buses.size() != 1)
        throw failure(exit_usage, fmt::format("{}: a bus of type replay stands beside another bus, expected it alone",
                                              config.path));
    if (replays > 0) require_edge_time(config, false);
    options.live = replays == 0;
    catch_stop_signals();
    session live(config, options);
    if (replays > 0)
        play_through(config.buses.front().file, config, live, std::nullopt, recording);
    else
        capture(config, live, options.duration_s, recording);
    live.finish();
}

} // namespace

void add_run(CLI::App& app) {
    auto given = std::make_shared<live_arguments>();
    CLI::App* command = app.add_subcommand("run", "Acquire from the buses of a CONFIG.toml and identify while it runs");
    command->add_option("config", given->config, "what to acquire and how to identify")
        ->required()
        ->type_name("CONFIG.toml");
    add_output_options(*command, *given);
    command->footer("Ends in order, with the result, on Ctrl-C, SIGTERM or after --duration.\n\n"
                    "Example:\n  okid run frame.toml --duration 60 --events events.jsonl --json result.json");
    command->callback([given] { run(*given); });
}

} // namespace okid_host
