// SPDX-License-Identifier: MIT
// PURPOSE  okid identify: measured records in, modes and a state-space model out
#include "commands.hpp"

#include "compare/set_ups.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/progress.hpp"
#include "files/whole_file.hpp"
#include "frequency/identify_responses.hpp"
#include "frequency/response_file.hpp"
#include "record/csv_header.hpp"
#include "record/hit_files.hpp"
#include "record/identify_options.hpp"
#include "record/proposal.hpp"
#include "record/record.hpp"
#include "record/request.hpp"
#include "record_files.hpp"
#include "result/mat_file.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

/// The command line as it was typed.
struct identify_arguments {
    record_request wanted;
    std::vector<std::string> records;
    std::string inputs, outputs, range, group, json, model;
    std::string exponential, references; ///< of frequency responses; of set-ups
    std::string places;                  ///< a regular expression on the names of the files
    bool quiet = false, all_modes = false, frf = false, set_ups = false;
};

[[noreturn]] void usage(const std::string& text) { throw failure(exit_usage, text); }

/// The names of the columns; says which there are when none were chosen.
void choose_columns(identify_arguments& given, record_files& files) {
    if (given.outputs.empty()) {
        const std::vector<std::string> columns = files.columns(given.records.front());
        const std::string proposed = proposed_options(columns);
        usage(fmt::format("--outputs is missing, expected the names of the response columns; {} has: {}{}{}",
                          given.records.front(), list_names(columns),
                          proposed.empty() ? "" : "; by their names perhaps", proposed));
    }
    if (!given.inputs.empty() && given.inputs != "none") given.wanted.inputs = split_names("--inputs", given.inputs);
    given.wanted.outputs = split_names("--outputs", given.outputs);
    for (const std::string& name : given.wanted.outputs)
        if (std::find(given.wanted.inputs.begin(), given.wanted.inputs.end(), name) != given.wanted.inputs.end())
            usage(fmt::format("\"{}\" is in --inputs and in --outputs, expected a column to be one of them",
                              printable(name)));
}

/// First and one past the last sample of `--range a:b`; either may be left out.
std::pair<std::size_t, std::size_t> check_range(const std::string& range, const csv_record& record) {
    if (range.empty()) return {0, record.count};
    const std::size_t colon = range.find(':');
    if (colon == std::string::npos)
        usage(fmt::format("--range: found \"{}\", expected a:b, samples a up to but not including b, counted from 0",
                          printable(range)));
    const auto count = static_cast<long long>(record.count);
    const std::string from = range.substr(0, colon), to = range.substr(colon + 1);
    const long long first = from.empty() ? 0 : whole_number("--range", from, 0, 1LL << 60);
    const long long last = to.empty() ? count : whole_number("--range", to, 0, 1LL << 60);
    if (last > count || first >= last)
        usage(fmt::format("--range {}: {} has samples 0 to {}, expected a below b and b at most {}", range, record.path,
                          count - 1, count));
    return {static_cast<std::size_t>(first), static_cast<std::size_t>(last)};
}

/// A result must not be written over a measurement, nor over the other result.
void check_targets(const identify_arguments& given) {
    for (const std::string& target : {given.json, given.model}) {
        if (target.empty()) continue;
        check_writable(target);
        for (const std::string& record : given.records) check_other_file(target, record);
    }
    if (!given.json.empty() && given.json == given.model)
        usage(fmt::format("--json and --model both name {}, expected two files", given.json));
}

/// A channel has one unit in all records. @param everywhere  it needs one in all of them, or in none
void check_units(const csv_record& record, const std::vector<std::string>& units, bool everywhere,
                 const std::string& first) {
    const auto said = [](const std::string& unit) { return unit.empty() ? "has no unit" : "is in " + printable(unit); };
    for (std::size_t c = 0; c < units.size(); ++c) {
        const std::string &own = record.units[c], &wanted = units[c];
        if (own == wanted || (!everywhere && (own.empty() || wanted.empty()))) continue;
        usage(fmt::format("{}: \"{}\" {}, in {} it {}; expected one unit: convert one of the files, or leave it out",
                          record.path, printable(record.columns[c]), said(own), first, said(wanted)));
    }
}

/// @param outputs  those of options.outputs that the records have
/// @param units  becomes those of the first record
record_set read_records(const identify_arguments& given, record_files& files, const std::vector<std::string>& outputs,
                        record_options& options, std::vector<std::string>& units, progress& display) {
    csv_request request;
    request.columns = options.inputs;
    request.columns.insert(request.columns.end(), outputs.begin(), outputs.end());
    if (!given.wanted.fs.empty()) request.fs_hz = check_rate(given.wanted.fs);
    request.progress = [&](double share) { display.share(share); };
    record_set set;
    set.n_u = options.inputs.size();
    set.n_y = outputs.size();
    for (const std::string& path : given.records) {
        display.stage("reading " + path);
        csv_record record = files.read(path, request);
        if (set.records.empty()) {
            options.fs_hz = record.fs_hz;
            units = record.units;
        }
        if (request.fs_hz && record.said_fs_hz && std::abs(*record.said_fs_hz / *request.fs_hz - 1) > 1e-9)
            options.said.emplace_back("fs_overrides_file",
                                      fmt::format("--fs {:g} is used, {} says {:g} Hz: every frequency "
                                                  "scales with it",
                                                  *request.fs_hz, path, *record.said_fs_hz));
        check_units(record, units, options.mass.wanted() || !options.hits.empty(), given.records.front());
        if (std::abs(record.fs_hz - options.fs_hz) > 1e-6 * options.fs_hz)
            usage(fmt::format(
                "{}: found a sample rate of {} Hz, expected {} Hz as in {}: only records of one rate can be merged",
                path, record.fs_hz, options.fs_hz, given.records.front()));
        const auto [first, last] = check_range(given.range, record);
        set.add(path, std::move(record.samples), first, last);
    }
    return set;
}

/// Units of the channels of a set-up among those of all; a sensor has one.
void keep_units(const std::vector<std::string>& outputs, const std::string& path, const std::vector<std::string>& own,
                const record_options& options, std::vector<std::string>& all) {
    for (std::size_t c = 0; c < own.size(); ++c) {
        const std::size_t n_u = options.inputs.size();
        const auto at = c < n_u ? options.inputs.end()
                                : std::find(options.outputs.begin(), options.outputs.end(), outputs[c - n_u]);
        std::string& known = all[c < n_u ? c : n_u + static_cast<std::size_t>(at - options.outputs.begin())];
        if (!known.empty() && !own[c].empty() && known != own[c])
            usage(fmt::format("{}: \"{}\" is in {}, in an earlier file in {}; expected one unit for a sensor: convert "
                              "one of the files, or leave it out",
                              path, printable(c < n_u ? options.inputs[c] : outputs[c - n_u]), printable(own[c]),
                              printable(known)));
        if (!own[c].empty()) known = own[c];
    }
}

/// Every file a set-up with those of the outputs that it has.
std::vector<set_up> read_each_set_up(const identify_arguments& given, record_files& files, record_options& options,
                                     progress& display) {
    std::vector<set_up> out;
    std::vector<std::string> left = options.outputs, units(options.inputs.size() + options.outputs.size());
    for (const std::string& path : given.records) {
        const std::vector<std::string> columns = files.columns(path);
        set_up one;
        for (const std::string& name : options.outputs)
            if (has_column(columns, name)) {
                one.outputs.push_back(name);
                left.erase(std::remove(left.begin(), left.end(), name), left.end());
            }
        if (one.outputs.empty())
            usage(fmt::format("{}: has none of the --outputs; it has: {}", path, list_names(columns)));
        identify_arguments alone = given;
        alone.records = {path};
        const double before = options.fs_hz;
        std::vector<std::string> own;
        one.set = read_records(alone, files, one.outputs, options, own, display);
        keep_units(one.outputs, path, own, options, units);
        if (!out.empty() && std::abs(options.fs_hz - before) > 1e-6 * before)
            usage(fmt::format("{}: found a sample rate of {} Hz, expected {} Hz as in {}", path, options.fs_hz, before,
                              given.records.front()));
        out.push_back(std::move(one));
    }
    if (!left.empty())
        usage(fmt::format("--outputs: no file has {}; {} has: {}", list_names(left), given.records.front(),
                          list_names(files.columns(given.records.front()))));
    take_record_units(units, options);
    return out;
}

record_result identify_files_of_responses(const identify_arguments& given) {
    response_request asked{given.wanted, given.exponential, given.all_modes};
    if (!given.range.empty()) usage("--range is an option of records, found with --frf");
    if (!given.places.empty()) usage("--places is an option of records, found with --frf");
    if (!given.group.empty()) usage("--group is an option of records, found with --frf");
    if (given.set_ups) usage("--setups is an option of records: several files with --frf are always set-ups");
    if (!given.inputs.empty()) asked.wanted.inputs = split_names("--inputs", given.inputs);
    if (!given.outputs.empty()) asked.wanted.outputs = split_names("--outputs", given.outputs);
    check_targets(given);
    progress display(!given.quiet);
    display.stage("identifying the frequency responses of " + given.records.front());
    return identify_responses(read_set_ups(given.records), asked);
}

record_result identify_files_of_samples(identify_arguments given) {
    if (!given.exponential.empty()) usage("--exponential belongs to --frf: it is the window in frequency responses");
    progress display(!given.quiet);
    display.stage("reading " + given.records.front());
    record_files files(given.group);
    choose_columns(given, files);
    if (!given.set_ups && !given.references.empty()) usage("--references belongs to --setups");
    const auto references =
        given.references.empty() ? std::vector<std::string>() : split_names("--references", given.references);
    if (given.set_ups && given.records.size() < 2) usage("--setups: found one file, expected one for each set-up");
    if (given.set_ups && !(given.places.empty() && given.wanted.hit_dofs.empty()))
        usage("--setups says that sensors were moved, --places and --hit-dofs that the hammer was: leave one out. If "
              "both were, identify each place of the sensors with --places --json, and join the results: okid merge");
    given.wanted.set_ups = given.set_ups;
    if (!given.places.empty()) {
        if (!given.wanted.hit_dofs.empty())
            usage("--places: --hit-dofs says where the records were struck, leave one of them out");
        given.wanted.hit_dofs = places_of_names(given.places, given.records);
    }
    record_options options = check_request(given.wanted);
    check_targets(given);
    options.all_modes = given.all_modes;
    options.stage = [&](const char* stage) { display.stage(stage); };
    record_result result;
    if (given.set_ups) {
        result = identify_set_ups(read_each_set_up(given, files, options, display), options, references);
    } else {
        std::vector<std::string> units;
        record_set records = read_records(given, files, options.outputs, options, units, display);
        take_record_units(units, options);
        result = identify_by_method(std::move(records), options);
    }
    finish_fits(result);
    result.context.all_modes = given.all_modes;
    return result;
}

void identify(const identify_arguments& given) {
    const record_result result = given.frf ? identify_files_of_responses(given) : identify_files_of_samples(given);
    const okid_identified_t& model = result.model.view();
    if (!given.model.empty()) write_whole_file(given.model, mat_file(model));
    if (!given.json.empty()) write_whole_file(given.json, result_text(result_json(model, result.context)));
    if (given.json != "-" && given.model != "-" && !given.quiet)
        write_whole_file("-", shown(result_table(model, result.context)));
}

/// Options: those of the table, the files before them.
void add_table(CLI::App& command, identify_arguments& given) {
    command
        .add_option(
            "records", given.records,
            "records of one structure, merged exactly: .csv, .npy, or what okid-convert reads (.mat, .uff, .mf4 ...)")
        ->required()
        ->type_name("RECORD.csv");
    record_request& wanted = given.wanted;
    for (const identify_option& option : identify_options()) {
        if (const auto* flag = std::get_if<bool record_request::*>(&option.place)) {
            command.add_flag(option.typed(), wanted.**flag, option.help);
            continue;
        }
        const auto* text = std::get_if<std::string record_request::*>(&option.place);
        std::string& value = text ? wanted.**text : option.key() == "inputs" ? given.inputs : given.outputs;
        if (option.kind == option_kind::answer)
            command.add_flag(option.typed() + "{yes}", value, option.help);
        else
            command.add_option(option.typed(), value, option.help)->type_name(option.shape);
    }
    command
        .add_option(
            "--places", given.places,
            "--hit-dofs from the names of the files: a regular expression whose group is the number of the place, as "
            "'P(\\d+)_' of P07_1.csv, and a second one its sign")
        ->type_name("REGEX");
}

/// Options: files of another kind.
void add_other_files(CLI::App& command, identify_arguments& given) {
    command.add_flag(
        "--frf", given.frf,
        "the files hold frequency responses: universal files (data sets 58, 58b) or CSV (frequency_hz, then "
        "OUT/IN:re and OUT/IN:im, or :db or :mag and :deg; :coh). Several files are set-ups of one structure. Takes "
        "--inputs, --outputs "
        "(default: all), --band, --modes, --sensing, --input-dofs, --output-dofs");
    command
        .add_option("--exponential", given.exponential,
                    "time constant of the exponential window in the responses (--frf): its damping is taken out")
        ->type_name("S");
    command.add_flag(
        "--setups", given.set_ups,
        "every file is a set-up of one structure, with those of the --outputs that it has: one set of modes, shapes "
        "scaled at the outputs in common (else at the force). Each set-up is identified by itself and the modes are "
        "merged; hits of one hammer, or all with --method plscf, together");
    command
        .add_option("--references", given.references,
                    "the outputs that scale the shapes of --setups (default: all that every file has)")
        ->type_name("NAMES");
    command.add_option("--range", given.range, "only samples a up to b (from 0, b not included) of each record")
        ->type_name("A:B");
    command
        .add_option("--group", given.group,
                    "part of a file that holds several rasters (.mf4, .tdms, .uff ...): its error message lists them")
        ->type_name("G");
}

/// Options: what comes out.
void add_targets(CLI::App& command, identify_arguments& given) {
    command.add_flag("--all-modes", given.all_modes,
                     "the table also lists the doubtful modes, and why they are doubtful");
    command.add_option("--json", given.json, "write okid.result/1 to this file, - is stdout")->type_name("FILE.json");
    command.add_option("--model", given.model, "write A, B, C, D, K, dt as a MAT file for scipy")
        ->type_name("FILE.mat");
    command.add_flag("--quiet", given.quiet, "no table, no progress");
}

} // namespace

void add_identify(CLI::App& app) {
    auto given = std::make_shared<identify_arguments>();
    CLI::App* command = app.add_subcommand("identify", "Identify modes and a model from measured CSV records");
    for (const auto& add : {add_table, add_other_files, add_targets}) add(*command, *given);
    command->footer(
        "Examples:\n  okid identify frame.csv --inputs force1 --outputs acc1,acc2,acc3 --json result.json\n"
        "  okid identify frame.csv --inputs force1 --outputs acc1,acc2,acc3 --input-dofs 1 --output-dofs 1,2,3\n"
        "  okid identify P*.csv --inputs hammer --outputs acc1,acc2 --places 'P(\\d+)_' --output-dofs 1,5\n"
        "  okid identify responses.uff --frf --json result.json\n"
        "  okid identify a.csv b.csv --setups --outputs ref1,ref2,deck1,deck2,deck3,deck4\n"
        "A CSV has a line of column names, numbers below, and \"# fs_hz: 1024\" above (or use --fs).");
    command->callback([given] { identify(*given); });
}

} // namespace okid_host
