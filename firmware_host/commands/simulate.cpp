// SPDX-License-Identifier: MIT
// okid simulate: a virtual rig with known M, K, R writes the log, record and truth a real one would give.
#include "commands.hpp"

#include "acquire/serial_line.hpp"
#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "files/progress.hpp"
#include "files/whole_file.hpp"
#include "result/result.hpp"
#include "rig/rig_files.hpp"
#include "rig/rig_frames.hpp"
#include "rig/rig_line.hpp"
#include "rig/rig_play.hpp"

#include <cstdio>
#include <filesystem>
#include <fmt/format.h>

namespace okid_host {
namespace {

namespace fs = std::filesystem;

struct simulate_arguments {
    std::string rig, log, truth, csv, dbc, config, to, hits;
    int baud = rig_line_baud, each = 3;
    bool quiet = false;
};

/// Where the DBC goes: as asked, else beside the configuration, else nowhere.
std::string dbc_path(const simulate_arguments& given) {
    if (!given.dbc.empty() || given.config.empty() || is_device(given.to)) return given.dbc;
    if (given.config == "-")
        throw failure(exit_usage, "--config - needs --dbc FILE: the configuration names that file");
    return fs::path(given.config).replace_extension(".dbc").string();
}

/// The DBC as the configuration names it, relative to its own folder.
std::string dbc_from_config(const std::string& dbc, const std::string& config) {
    if (config == "-") return fs::absolute(dbc).lexically_normal().string();
    return fs::absolute(dbc)
        .lexically_normal()
        .lexically_proximate(fs::absolute(config).lexically_normal().parent_path())
        .string();
}

void check_targets(const simulate_arguments& given, const std::string& dbc) {
    const std::vector<std::string> targets{given.log, given.truth, given.csv, dbc, given.config};
    bool any = !given.to.empty() || !given.hits.empty();
    for (std::size_t i = 0; i < targets.size(); ++i) {
        if (targets[i].empty()) continue;
        any = true;
        check_writable(targets[i]);
        std::error_code ignored;
        if (fs::equivalent(targets[i], given.rig, ignored))
            throw failure(exit_usage, fmt::format("{}: is the rig itself, it is not overwritten", targets[i]));
        for (std::size_t j = 0; j < i; ++j)
            if (targets[i] == targets[j] && targets[i] != "/dev/null")
                throw failure(exit_usage,
                              fmt::format("{} was given for two outputs, expected a file for each", targets[i]));
    }
    if (!any)
        throw failure(exit_usage,
                      "nothing to write: give at least one of --log, --truth, --csv, --hits, --dbc, --config, --to");
}

void warn(const simulate_arguments& given, const std::string& text) {
    if (!given.quiet) say("okid: {}: {}\n", given.rig, text);
}

void check_line(const simulate_arguments& given, const rig_run& run) {
    if (!is_device(given.to)) return;
    const double needed = rig_line_rate(run);
    if (needed > given.baud)
        warn(given, fmt::format("the packets need {:.0f} bit/s, a line of {} baud cannot carry them in real time",
                                needed, given.baud));
}

void check_bus(const simulate_arguments& given, const rig_run& run) {
    const std::size_t messages = rig_messages(run).size();
    const double needed = static_cast<double>(messages) * 130e-6 * run.rate_hz;
    if (needed > 0.95 && !(given.log.empty() && (given.to.empty() || is_device(given.to))))
        warn(
            given,
            fmt::format(
                "{} frames a sample at {:g} Hz would load a 1 Mbit/s bus by {:.0f} %: the log is valid, but no classic "
                "CAN bus could carry it",
                messages, run.rate_hz, 100 * needed));
}

/// The folder of a roving hammer: P01_1.csv, P01_2.csv … P02_1.csv …, the number of the place first.
void write_hits(const simulate_arguments& given, const rig& rig) {
    if (rig.excitation != "hammer")
        throw failure(exit_usage, fmt::format("--hits: {} has excitation = \"{}\", expected \"hammer\"", given.rig,
                                              rig.excitation));
    std::error_code fault;
    fs::create_directories(given.hits, fault);
    if (fault) throw failure(exit_usage, fmt::format("--hits: {}: {}", given.hits, fault.message()));
    for (std::size_t place = 0; place < rig.force_dofs.size(); ++place)
        for (int number = 1; number <= given.each; ++number) {
            const std::string name = fmt::format("P{:02}_{}.csv", rig.force_dofs[place], number);
            write_whole_file((fs::path(given.hits) / name).string(), rig_csv(simulate_hit(rig, place, number)));
        }
}

std::string summary(const rig& rig, const rig_run& run) {
    std::string out = fmt::format("{} samples at {:g} Hz, forces {}, sensors {}, frames {}\n", run.count, run.rate_hz,
                                  run.forces, run.channels.size() - run.forces, run.count * rig_messages(run).size());
    const rig_modes modes = structure_modes(rig.body);
    out += "   #       f [Hz]     ζ [%]\n";
    for (std::size_t k = 0; k < modes.frequency_hz.size(); ++k)
        out += fmt::format("{:>4} {:>12.5f} {:>9.4f}\n", k + 1, modes.frequency_hz[k], 100 * modes.damping_ratio[k]);
    return out;
}

void simulate(const simulate_arguments& given) {
    const rig rig = load_rig(given.rig);
    const std::string dbc = dbc_path(given);
    check_targets(given, dbc);
    for (const std::string& text : rig.warnings) warn(given, text);
    rig_run run;
    {
        progress display(!given.quiet);
        display.stage("simulating");
        run = simulate_rig(rig);
        check_bus(given, run);
        check_line(given, run);
        display.stage("writing");
        if (!given.log.empty()) write_whole_file(given.log, rig_log(run));
        if (!given.truth.empty()) write_whole_file(given.truth, rig_truth(rig));
        if (!given.csv.empty()) write_whole_file(given.csv, rig_csv(run));
        if (!given.hits.empty()) write_hits(given, rig);
        if (!dbc.empty()) write_whole_file(dbc, rig_dbc(run));
        if (!given.config.empty())
            write_whole_file(given.config, is_device(given.to)
                                               ? rig_line_config(rig, run, given.to, given.baud)
                                               : rig_config(rig, run, dbc_from_config(dbc, given.config)));
    }
    const bool to_stdout =
        given.log == "-" || given.truth == "-" || given.csv == "-" || given.dbc == "-" || given.config == "-";
    if (!given.quiet && !to_stdout) write_whole_file("-", shown(summary(rig, run)));
    if (given.to.empty()) return;
    play_rig(run, given.to, given.baud);
    if (stop_requested()) throw failure(exit_interrupted, "interrupted before the record ended");
}

} // namespace

void add_simulate(CLI::App& app) {
    auto given = std::make_shared<simulate_arguments>();
    CLI::App* command = app.add_subcommand("simulate", "Play a virtual rig with known mass, stiffness and damping");
    command->add_option("rig", given->rig, "the masses, springs, sensors and forces of the rig")
        ->required()
        ->type_name("RIG.toml");
    command->add_option("--log", given->log, "CAN frames in the format of candump -L")->type_name("FILE.log");
    command->add_option("--truth", given->truth, "true modes and matrices, okid.truth/1")->type_name("FILE.json");
    command->add_option("--csv", given->csv, "the same samples in engineering units")->type_name("FILE.csv");
    command
        ->add_option(
            "--hits", given->hits,
            "a folder of hits, as a roving hammer leaves it: one CSV each, P01_1.csv is the first at force_dofs "
            "number 1")
        ->type_name("FOLDER");
    command->add_option("--each", given->each, "hits at each place for --hits, 1 to 100 (default 3)")
        ->type_name("N")
        ->check(CLI::Range(1, 100).description(""));
    command->add_option("--dbc", given->dbc, "description of the frames")->type_name("FILE.dbc");
    command
        ->add_option("--config", given->config, "CONFIG.toml for okid run and okid replay (writes the DBC beside it)")
        ->type_name("FILE.toml");
    command
        ->add_option("--to", given->to, "send in real time: frames on a CAN interface, or packets on a serial device")
        ->type_name("INTERFACE|DEVICE");
    command->add_option("--baud", given->baud, "baud rate of the serial device, 50 to 20000000 (default 921600)")
        ->type_name("N")
        ->check(CLI::Range(50, 20000000).description(""));
    command->add_flag("--quiet", given->quiet, "no summary, no warnings");
    command->footer("Example:\n  okid simulate rig.toml --log rig.log --truth truth.json --config rig-config.toml\n"
                    "  okid replay rig.log -c rig-config.toml\n"
                    "The same seed gives the same bytes. `-` is stdout.");
    command->callback([given] { simulate(*given); });
}

} // namespace okid_host
