// SPDX-License-Identifier: MIT
// okid run: acquire, identify and show while it happens.
#include "acquire/stop_signal.hpp"
#include "commands.hpp"
#include "live/capture.hpp"
#include "live/playback.hpp"
#include "live/session.hpp"
#include "live_options.hpp"

#include <memory>

namespace okid_host {
namespace {

void run(const live_arguments& given) {
    const live_config config = load_config(given.config);
    const bool from_log = plays_a_log(config);
    session_options options = check_live(given, config, from_log ? config.buses.front().file : "");
    std::optional<recorder_options> recording;
    if (config.record.wanted) recording = recorder_options{options.duration_s};
    options.live = !from_log;
    catch_stop_signals();
    session live(config, options);
    if (from_log)
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
    command->footer("Ends cleanly, with the result, on Ctrl-C, SIGTERM or after --duration.\n\n"
                    "Example:\n  okid run frame.toml --duration 60 --events events.jsonl --json result.json");
    command->callback([given] { run(*given); });
}

} // namespace okid_host
