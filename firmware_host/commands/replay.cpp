// SPDX-License-Identifier: MIT
// okid replay: a recorded log through the live path, or onto a bus.
#include "acquire/stop_signal.hpp"
#include "commands.hpp"
#include "error.hpp"
#include "files/progress.hpp"
#include "live/playback.hpp"
#include "live/session.hpp"
#include "live_options.hpp"

#include <fmt/format.h>
#include <memory>
#include <unistd.h>

namespace okid_host {
namespace {

struct replay_arguments : live_arguments {
    std::string log, to, trigger;
};

/// The one given, or that of the journal.
live_config config_for(const replay_arguments& given, const std::optional<journal_header>& header) {
    if (!given.config.empty()) return load_config(given.config);
    if (!header) throw failure(exit_usage, "-c CONFIG.toml is missing (or --to INTERFACE, to play the log onto a bus)");
    if (header->texts.config.empty())
        throw failure(exit_usage, fmt::format("{}: the config in it is {}; give -c CONFIG.toml", given.log,
                                              header->whole ? "missing" : "damaged"));
    live_config config = load_config(given.log, header->texts);
    config.publish = {}; // the run's listeners were for the run; a journal of somebody else opens nothing here
    return config;
}

void replay(const replay_arguments& given) {
    const std::optional<double> speed = parse_speed(given.speed);
    if (!given.to.empty()) {
        if (!given.config.empty() || !given.events.empty() || !given.json.empty() || !given.duration.empty() ||
            !given.trigger.empty())
            throw failure(
                exit_usage,
                "--to plays the log onto a bus and identifies nothing: leave -c, --events, --json, --duration and "
                "--trigger-at out");
        progress display(!given.quiet);
        display.stage("playing " + given.log);
        play_onto_bus(given.log, given.to, given.speed.empty() ? std::optional<double>(1.0) : speed,
                      [&display](double share) { display.share(share); });
        return;
    }
    std::optional<journal_header> header;
    if (is_journal(given.log)) header = read_journal_header(given.log);
    const live_config config = config_for(given, header);
    session_options options = check_live(given, config, given.log);
    options.trigger_ns = parse_stamp("--trigger-at", given.trigger);
    if (options.trigger_ns && config.trigger.source != trigger_source::gpio)
        throw failure(exit_usage, fmt::format("--trigger-at stands for the edge of a GPIO line, but [trigger] of {} "
                                              "has another source",
                                              config.path));
    if (header && config.trigger.source == trigger_source::gpio && !options.trigger_ns)
        options.trigger_ns = header->trigger_ns;
    if (header && !options.duration_s) options.duration_s = header->duration_s; // as long as the run was
    require_edge_time(config, options.trigger_ns.has_value());
    catch_stop_signals();
    session played(config, options);
    const bool beside_a_table = isatty(STDOUT_FILENO) && isatty(STDERR_FILENO);
    {
        progress display(!given.quiet && !beside_a_table);
        display.stage("replaying " + given.log);
        play_through(given.log, config, played, speed, std::nullopt,
                     [&display](double share) { display.share(share); });
    }
    played.finish();
}

} // namespace

void add_replay(CLI::App& app) {
    auto given = std::make_shared<replay_arguments>();
    CLI::App* command =
        app.add_subcommand("replay", "Play a journal or a candump -L log through the live path, or onto a bus");
    command
        ->add_option("log", given->log,
                     "a journal of okid record (.okj) and the segments behind it, or a log of candump -L")
        ->required()
        ->type_name("LOG.okj|LOG.log");
    command
        ->add_option("-c,--config", given->config, "what the frames mean and how to identify; a journal holds its own")
        ->type_name("CONFIG.toml");
    command
        ->add_option("--speed", given->speed,
                     "max (default), or a multiple of the log's own time (default with --to: 1)")
        ->type_name("N|max");
    command->add_option("--to", given->to, "play onto this interface or slcan adapter instead")
        ->type_name("INTERFACE|DEVICE");
    command
        ->add_option("--trigger-at", given->trigger,
                     "when the GPIO edge came, in the log's time (time_s of the trigger event of the live run)")
        ->type_name("SECONDS");
    add_output_options(*command, *given);
    command->get_option("--quiet")->description("no modes, no table, no progress");
    command->footer("The result is the same at every speed, and that of the run a journal was recorded by.\n\n"
                    "Examples:\n  okid replay runs/frame-20261121T120000Z-0001.okj\n  okid replay frame.log -c "
                    "frame.toml --json result.json\n  okid replay frame.log --to "
                    "vcan0 --speed 2");
    command->callback([given] { replay(*given); });
}

} // namespace okid_host
