// SPDX-License-Identifier: MIT
// okid identify: measured records in, modes and a state-space model out.
#include "commands.hpp"

#include "config/nearest_name.hpp"
#include "error.hpp"
#include "files/whole_file.hpp"
#include "progress.hpp"
#include "record/csv_header.hpp"
#include "record/record.hpp"
#include "record/record_check.hpp"
#include "result/deviations.hpp"
#include "result/mat_file.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

/// The command line as it was typed.
struct identify_arguments {
    std::vector<std::string> records;
    std::string inputs, outputs, method = "okid-era", hankel = "system", order = "auto", hold = "zoh", detrend = "mean",
                                 start = "moving";
    std::string sensing = "acceleration", input_dofs, output_dofs, range, json, model;
    std::string fs, p, rows, sigma_blocks;
    bool refine = false, stabilization = false, quiet = false;
};

[[noreturn]] void usage(const std::string& text) { throw failure(exit_usage, text); }

void one_of(const std::string& option, const std::string& value, const std::vector<std::string>& choices) {
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return;
    usage(fmt::format("{}: found \"{}\"{}, expected one of: {}", option, printable(value), did_you_mean(value, choices),
                      list_names(choices)));
}

long long whole_number(const std::string& option, const std::string& text, long long low, long long high) {
    long long value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || value < low || value > high)
        usage(
            fmt::format("{}: found \"{}\", expected a whole number from {} to {}", option, printable(text), low, high));
    return value;
}

void check_refine(const identify_arguments& given) {
    if (given.refine && given.inputs.empty())
        usage("--refine needs a measured force: without --inputs (ambient) there is nothing to simulate");
}

/// The inputs and outputs, checked; names the columns there are when none were chosen.
void choose_channels(const identify_arguments& given, record_options& options) {
    const auto columns = [&] { return list_names(read_csv_columns(given.records.front())); };
    if (given.outputs.empty())
        usage(fmt::format("--outputs is missing, expected the names of the response columns; {} has: {}",
                          given.records.front(), columns()));
    if (!given.inputs.empty()) options.inputs = split_names("--inputs", given.inputs);
    options.outputs = split_names("--outputs", given.outputs);
    for (const std::string& name : options.outputs)
        if (std::find(options.inputs.begin(), options.inputs.end(), name) != options.inputs.end())
            usage(fmt::format("\"{}\" stands in --inputs and in --outputs, expected a column to be one of them",
                              printable(name)));
    if (options.inputs.size() + options.outputs.size() > 256)
        usage(fmt::format("{} channels were chosen, at most 256 can be identified together",
                          options.inputs.size() + options.outputs.size()));
}

/// One kind for each output.
std::vector<int> check_sensing(const std::string& sensing, std::size_t outputs) {
    std::vector<std::string> kinds;
    for (std::size_t at = 0; at <= sensing.size();) {
        const std::size_t comma = std::min(sensing.find(',', at), sensing.size());
        kinds.push_back(sensing.substr(at, comma - at));
        at = comma + 1;
    }
    for (const std::string& kind : kinds) one_of("--sensing", kind, {"acceleration", "velocity", "displacement"});
    if (kinds.size() != 1 && kinds.size() != outputs)
        usage(fmt::format("--sensing: found {} kinds for {} outputs, expected one for all or one for each",
                          kinds.size(), outputs));
    std::vector<int> out;
    for (std::size_t i = 0; i < outputs; ++i) out.push_back(sensing_of(kinds[kinds.size() == 1 ? 0 : i]));
    return out;
}

/// The degrees of freedom of the channels, when any are given.
mass_plan check_dofs(const identify_arguments& given, const record_options& options, const std::vector<int>& sensing) {
    mass_plan plan;
    if (given.input_dofs.empty() && given.output_dofs.empty()) return plan;
    for (const auto& [option, other, list] : {std::tuple{"--input-dofs", "--output-dofs", &given.input_dofs},
                                              std::tuple{"--output-dofs", "--input-dofs", &given.output_dofs}})
        if (list->empty()) usage(fmt::format("{} is missing: {} is given, M, K and R need both", option, other));
    for (const std::string& name : options.inputs) plan.inputs.emplace_back().name = name;
    for (const std::string& name : options.outputs) plan.outputs.emplace_back().name = name;
    for (std::size_t i = 0; i < sensing.size(); ++i) plan.outputs[i].sensing = sensing[i];
    plan.hold = options.hold;
    read_dofs("--input-dofs", given.input_dofs, "input", plan.inputs);
    read_dofs("--output-dofs", given.output_dofs, "output", plan.outputs);
    if (const std::string fault = plan_fault(plan); !fault.empty())
        usage(fmt::format("--input-dofs, --output-dofs: {}", fault));
    return plan;
}

record_options check_options(const identify_arguments& given) {
    record_options options;
    one_of("--method", given.method, method_names());
    one_of("--hankel", given.hankel, hankel_names());
    check_refine(given);
    one_of("--hold", given.hold, {"zoh", "foh"});
    one_of("--detrend", given.detrend, {"none", "mean", "linear"});
    one_of("--start", given.start, {"moving", "rest"});
    options.p_given = !given.p.empty();
    if (options.p_given) options.p = static_cast<int>(whole_number("--p", given.p, 1, 4096));
    if (!given.rows.empty()) options.rows = static_cast<int>(whole_number("--rows", given.rows, 2, 100000));
    if (given.order != "auto") {
        if (given.order.empty() || given.order[0] < '0' || given.order[0] > '9')
            usage(fmt::format("--order: found \"{}\", expected a whole number or auto", printable(given.order)));
        options.order = static_cast<int>(whole_number("--order", given.order, 1, 10000));
    }
    if (!given.sigma_blocks.empty())
        options.sigma_blocks = static_cast<int>(whole_number("--sigma-blocks", given.sigma_blocks, 0, most_blocks));
    if (options.sigma_blocks > 0 && options.sigma_blocks < fewest_blocks)
        usage(fmt::format("--sigma-blocks: found {}, expected 0 (no standard deviations) or {} to {}",
                          options.sigma_blocks, fewest_blocks, most_blocks));
    options.stabilization = given.stabilization;
    options.method = given.method;
    options.hankel = given.hankel;
    options.refine = given.refine;
    options.hold = given.hold;
    options.detrend = given.detrend;
    options.start = given.start;
    choose_channels(given, options);
    if (const std::string fault = hankel_fault(given.hankel, given.method, options.inputs.size()); !fault.empty())
        usage("--hankel: " + fault);
    options.mass = check_dofs(given, options, check_sensing(given.sensing, options.outputs.size()));
    return options;
}

std::optional<double> check_rate(const std::string& text) {
    if (text.empty()) return std::nullopt;
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !(value > 0) || !std::isfinite(value))
        usage(fmt::format("--fs: found \"{}\", expected a sample rate in Hz above 0", printable(text)));
    return value;
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

std::vector<record_data> read_records(const identify_arguments& given, record_options& options, progress& display) {
    csv_request request;
    request.columns = options.inputs;
    request.columns.insert(request.columns.end(), options.outputs.begin(), options.outputs.end());
    request.fs_hz = check_rate(given.fs);
    std::vector<record_data> records;
    std::vector<std::string> units;
    for (const std::string& path : given.records) {
        request.progress = [&](double megabytes) {
            display.stage(fmt::format("reading {}, {:.0f} MB", path, megabytes));
        };
        const csv_record record = read_csv(path, request);
        if (records.empty()) {
            options.fs_hz = record.fs_hz;
            units = record.units;
            remark_exchanged(units, options, options.said);
            if (options.mass.wanted()) take_units(units, options.mass, options.said);
        }
        if (request.fs_hz && record.said_fs_hz && std::abs(*record.said_fs_hz / *request.fs_hz - 1) > 1e-9)
            options.said.emplace_back("fs_overrides_file",
                                      fmt::format("--fs {:g} is used, {} says {:g} Hz: every frequency "
                                                  "scales with it",
                                                  *request.fs_hz, path, *record.said_fs_hz));
        if (options.mass.wanted() && record.units != units)
            usage(fmt::format("{}: the units in the header are not those of {}, expected the same for M, K and R", path,
                              given.records.front()));
        if (std::abs(record.fs_hz - options.fs_hz) > 1e-6 * options.fs_hz)
            usage(fmt::format(
                "{}: found a sample rate of {} Hz, expected {} Hz as in {}: only records of one rate can be merged",
                path, record.fs_hz, options.fs_hz, given.records.front()));
        const auto [first, last] = check_range(given.range, record);
        records.push_back(split_record(record, options.inputs.size(), first, last));
    }
    return records;
}

/// One key a line, so that a person can look into it; matrices stay compact.
std::string result_text(const nlohmann::ordered_json& result) {
    std::string out = "{\n";
    std::size_t left = result.size();
    for (const auto& [key, value] : result.items())
        out += fmt::format("\"{}\":{}{}\n", key,
                           value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace),
                           --left ? "," : "");
    return out + "}\n";
}

void identify(const identify_arguments& given) {
    record_options options = check_options(given);
    check_targets(given);
    record_result result;
    {
        progress display(!given.quiet);
        options.stage = [&](const char* stage) { display.stage(stage); };
        result = identify_records(read_records(given, options, display), options);
    }
    if (!given.model.empty()) write_whole_file(given.model, mat_file(result.model));
    if (!given.json.empty()) write_whole_file(given.json, result_text(result_json(result.model, result.context)));
    if (given.json != "-" && given.model != "-" && !given.quiet)
        write_whole_file("-", result_table(result.model, result.context));
}

} // namespace

void add_identify(CLI::App& app) {
    auto given = std::make_shared<identify_arguments>();
    CLI::App* command = app.add_subcommand("identify", "Identify modes and a model from measured CSV records");
    command->add_option("records", given->records, "CSV records of one structure, merged exactly")
        ->required()
        ->type_name("RECORD.csv");
    command->add_option("--inputs", given->inputs, "force columns, with commas between; none = ambient: modes only")
        ->type_name("NAMES");
    command->add_option("--outputs", given->outputs, "response columns, with commas between")->type_name("NAMES");
    command->add_option("--fs", given->fs, "sample rate; default: what the file says")->type_name("HZ");
    command->add_option("--method", given->method, "how the model is found (default okid-era)")
        ->type_name(fmt::format("{}", fmt::join(method_names(), "|")));
    command->add_option("--p", given->p, "observer order in samples (default 40; not for n4sid)")->type_name("N");
    command
        ->add_option("--rows", given->rows,
                     "block rows of the Hankel matrix (default 2 p, n4sid 30, okid without inputs p)")
        ->type_name("N");
    command
        ->add_option("--hankel", given->hankel,
                     "what the Hankel matrix of the okid methods holds: system (default), innovations (those too, "
                     "weighted: free of units) or literal (eq. 42 as printed, for comparison only)")
        ->type_name(fmt::format("{}", fmt::join(hankel_names(), "|")));
    command->add_option("--order", given->order, "number of states, or auto (default)")->type_name("N|auto");
    command->add_option("--hold", given->hold, "force between samples: held (zoh, default) or linear (foh)")
        ->type_name("zoh|foh");
    command->add_option("--detrend", given->detrend, "what is taken out of every channel first (default mean)")
        ->type_name("none|mean|linear");
    command
        ->add_option(
            "--start", given->start,
            "moving (default): nothing is known before the record; rest: every record begins with the structure "
            "at rest, as a hammer test with a short pre-trigger does")
        ->type_name("moving|rest");
    command
        ->add_option("--sensing", given->sensing,
                     "what the outputs measure (default acceleration): one kind, or one per output with commas between")
        ->type_name("acceleration|velocity|displacement");
    command
        ->add_option("--input-dofs", given->input_dofs,
                     "where each force acts: numbers of degrees of freedom from 1 (-3: at 3, polarity reversed). With "
                     "--output-dofs: mass, stiffness and damping matrices")
        ->type_name("LIST");
    command
        ->add_option("--output-dofs", given->output_dofs,
                     "where each sensor stands; every degree of freedom needs a force or a sensor, one needs both")
        ->type_name("LIST");
    command->add_flag("--refine", given->refine,
                      "improve the model by maximum likelihood: with noise at the sensors nothing can be more exact. "
                      "Needs --inputs");
    command->add_flag(
        "--stabilization", given->stabilization,
        "look at all orders and three horizons too, and list the modes that hold (JSON: \"stabilization\")");
    command
        ->add_option("--sigma-blocks", given->sigma_blocks,
                     "blocks of the record left out in turn for the standard deviations (default 20), 0 = none")
        ->type_name("N");
    command->add_option("--range", given->range, "only samples a up to b (from 0, b not included) of each record")
        ->type_name("A:B");
    command->add_option("--json", given->json, "write okid.result/1 to this file, - is stdout")->type_name("FILE.json");
    command->add_option("--model", given->model, "write A, B, C, D, K, dt as a MAT file for scipy")
        ->type_name("FILE.mat");
    command->add_flag("--quiet", given->quiet, "no table, no progress");
    command->footer(
        "Examples:\n  okid identify frame.csv --inputs force1 --outputs acc1,acc2,acc3 --json result.json\n"
        "  okid identify frame.csv --inputs force1 --outputs acc1,acc2,acc3 --input-dofs 1 --output-dofs 1,2,3\n"
        "A CSV has a line of column names, numbers below, and \"# fs_hz: 1024\" above (or use --fs).");
    command->callback([given] { identify(*given); });
}

} // namespace okid_host
