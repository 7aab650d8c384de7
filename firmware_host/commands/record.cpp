// SPDX-License-Identifier: MIT
// okid record: raw frames onto the disk, nothing else.
#include "acquire/stop_signal.hpp"
#include "commands.hpp"
#include "live/capture.hpp"
#include "live/playback.hpp"
#include "live/record_watch.hpp"
#include "live_options.hpp"

#include <cstdio>
#include <memory>

namespace okid_host {
namespace {

struct record_arguments {
    std::string config, duration, directory;
};

void record(const record_arguments& given) {
    live_config config = load_config(given.config);
    if (!given.directory.empty()) config.record.directory = given.directory;
    const std::optional<double> duration_s = parse_seconds("--duration", given.duration);
    for (const std::string& text : config.warnings) say("okid: {}: {}\n", config.path, text);
    const recorder_options recording{duration_s};
    const bool from_log = plays_a_log(config);
    catch_stop_signals();
    catch_hangups();
    record_watch watch(config, duration_s);
    if (from_log)
        play_through(config.buses.front().file, config, watch, std::nullopt, recording);
    else
        capture(config, watch, duration_s, recording);
    watch.finish();
}

} // namespace

void add_record(CLI::App& app) {
    auto given = std::make_shared<record_arguments>();
    CLI::App* command = app.add_subcommand("record", "Record the frames of the buses of a CONFIG.toml into a journal");
    command->add_option("config", given->config, "what to acquire; it goes into the journal")
        ->required()
        ->type_name("CONFIG.toml");
    command->add_option("--duration", given->duration, "end after this much stream time")->type_name("SECONDS");
    command->add_option("--directory", given->directory, "write there instead of the directory of [record]")
        ->type_name("FOLDER");
    command->footer("Ends cleanly on Ctrl-C, SIGTERM or after --duration; a kill or a power cut costs at most the last "
                    "quarter of a second.\n\nExample:\n  okid record frame.toml --duration 3600 --directory /data");
    command->callback([given] { record(*given); });
}

} // namespace okid_host
