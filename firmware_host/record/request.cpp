// SPDX-License-Identifier: MIT
// PURPOSE  checks what a user asks of an identification, for the program and for other languages
// METHOD   everything comes as text, so that the same words answer the same mistake wherever it is made
#include "request.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "identify_options.hpp"
#include "picks.hpp"
#include "record_check.hpp"
#include "result/method.hpp"
#include "roving.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <optional>

namespace okid_host {
namespace {

constexpr const char* default_method = "auto";

[[noreturn]] void usage(const std::string& text) { throw failure(exit_usage, text); }

void one_of(const std::string& option, const std::string& value, const std::vector<std::string>& choices) {
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return;
    usage(fmt::format("{}: found \"{}\"{}, expected one of: {}", option, printable(value), did_you_mean(value, choices),
                      list_names(choices)));
}

void check_words(const record_request& given) {
    for (const identify_option& option : identify_options())
        if ((option.kind == option_kind::words || option.kind == option_kind::answer) && option.is_given(given))
            one_of(option.typed(), given.*std::get<std::string record_request::*>(option.place), option.alternatives());
}

/// The number of an option of kind whole or whole_or_auto; nothing where none is given.
std::optional<int> whole_of(const record_request& given, std::string record_request::* place) {
    for (const identify_option& option : identify_options()) {
        const auto* own = std::get_if<std::string record_request::*>(&option.place);
        if (!own || *own != place || !option.is_given(given)) continue;
        const std::string& text = given.*place;
        if (option.kind == option_kind::whole_or_auto && (text.empty() || text[0] < '0' || text[0] > '9')) {
            if (text == "auto") return std::nullopt;
            usage(fmt::format("{}: found \"{}\", expected a whole number or auto", option.typed(), printable(text)));
        }
        return static_cast<int>(whole_number(option.typed(), text, option.low, option.high));
    }
    return std::nullopt;
}

void check_refine(const record_request& given) {
    if (given.refine == "yes" && given.inputs.empty())
        usage("--refine needs a measured force: without --inputs (ambient) there is nothing to simulate");
}

void check_channels(const record_request& given) {
    if (given.outputs.empty()) usage("--outputs is missing, expected the names of the responses");
    for (const auto& [option, names] : {std::pair{"--inputs", &given.inputs}, std::pair{"--outputs", &given.outputs}})
        for (std::size_t i = 1; i < names->size(); ++i)
            if (std::find(names->begin(), names->begin() + static_cast<std::ptrdiff_t>(i), (*names)[i]) !=
                names->begin() + static_cast<std::ptrdiff_t>(i))
                usage(fmt::format("{}: the name \"{}\" stands twice", option, printable((*names)[i])));
    const std::size_t channels = given.inputs.size() + given.outputs.size();
    if (channels > 256) usage(fmt::format("{} channels were chosen, at most 256 can be identified together", channels));
}

/// "3,7,-12": where each record was struck.
std::vector<int> check_hit_dofs(const record_request& given) {
    std::vector<int> out;
    if (given.hit_dofs.empty()) return out;
    if (given.inputs.size() != 1)
        usage(fmt::format("--hit-dofs or --places: found {} columns in --inputs, expected one, the force of the hammer",
                          given.inputs.size()));
    if (!given.input_dofs.empty()) usage("--input-dofs: --hit-dofs says where the forces act, leave one of them out");
    for (std::size_t at = 0; at <= given.hit_dofs.size();) {
        const std::size_t comma = std::min(given.hit_dofs.find(',', at), given.hit_dofs.size());
        out.push_back(
            static_cast<int>(whole_number("--hit-dofs", given.hit_dofs.substr(at, comma - at), -10000, 10000)));
        if (out.back() == 0) usage("--hit-dofs: found 0, expected numbers from 1 (-3: at 3, direction reversed)");
        at = comma + 1;
    }
    const std::size_t places = hit_places(out).size();
    if (places + given.outputs.size() > 256)
        usage(fmt::format("--hit-dofs: found {} places, with the outputs more than 256 channels", places));
    return out;
}

/// The degrees of freedom of the channels, when any are given.
mass_plan check_dofs(const record_request& given, const record_options& options, const std::vector<int>& sensing) {
    mass_plan plan;
    if (given.input_dofs.empty() && given.output_dofs.empty()) return plan;
    if (!options.hits.empty()) {
        for (const int place : hit_places(options.hits))
            plan.inputs.push_back({fmt::format("{}@{}", options.inputs.front(), place), place});
        for (const std::string& name : options.outputs) plan.outputs.emplace_back().name = name;
        for (std::size_t i = 0; i < sensing.size(); ++i) plan.outputs[i].sensing = sensing[i];
        plan.hold = options.hold;
        read_dofs("--output-dofs", given.output_dofs, "output", plan.outputs);
        return plan;
    }
    for (const auto& [option, other, list] : {std::tuple{"--input-dofs", "--output-dofs", &given.input_dofs},
                                              std::tuple{"--output-dofs", "--input-dofs", &given.output_dofs}})
        if (list->empty()) usage(fmt::format("{} is missing: {} is given, M, K and R need both", option, other));
    for (const std::string& name : options.inputs) plan.inputs.emplace_back().name = name;
    for (const std::string& name : options.outputs) plan.outputs.emplace_back().name = name;
    for (std::size_t i = 0; i < sensing.size(); ++i) plan.outputs[i].sensing = sensing[i];
    plan.hold = options.hold;
    read_dofs("--input-dofs", given.input_dofs, "input", plan.inputs);
    read_dofs("--output-dofs", given.output_dofs, "output", plan.outputs);
    if (const std::string fault = plan_fault(plan); !fault.empty() && !given.set_ups)
        usage(fmt::format("--input-dofs, --output-dofs: {}", fault));
    return plan;
}

/// An option of one method alone means the method that release 0.1 took by default.
std::string chosen_method(const record_request& given) {
    if (!given.method.empty()) return given.method;
    const auto& options = identify_options();
    const bool single = given.refine == "yes" || given.stabilization ||
                        std::any_of(options.begin(), options.end(), [&](const identify_option& option) {
                            return option.methods == option_methods::one && option.is_given(given);
                        });
    return single ? "okid-era" : default_method;
}

double hertz(const std::string& option, const std::string& text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !(value >= 0) || !std::isfinite(value))
        usage(fmt::format("{}: found \"{}\", expected a frequency in Hz", option, printable(text)));
    return value;
}

/// "1,3-5" as numbers.
std::vector<int> numbers_of(const std::string& option, const std::string& text) {
    std::vector<int> out;
    for (std::size_t at = 0; at <= text.size();) {
        const std::size_t comma = std::min(text.find(',', at), text.size());
        const std::string part = text.substr(at, comma - at);
        const std::size_t dash = part.find('-');
        const long long first = whole_number(option, part.substr(0, dash), 1, 10000);
        const long long last =
            dash == std::string::npos ? first : whole_number(option, part.substr(dash + 1), first, 10000);
        for (long long k = first; k <= last; ++k) out.push_back(static_cast<int>(k));
        at = comma + 1;
    }
    return out;
}

/// The options of method auto, and those that are none.
void check_agreement(const record_request& given, record_options& options) {
    const bool agreed = options.method == "auto";
    const bool of_lags = options.method == lag_method;
    for (const identify_option& option : identify_options()) {
        if (!option.is_given(given)) continue;
        const bool lags_too = option.methods == option_methods::agreement_or_lags;
        if (!agreed && (option.methods == option_methods::agreement || (lags_too && !of_lags)))
            usage(fmt::format("{} belongs to --method auto, {} takes the record as it is", option.typed(),
                              options.method));
        if (option.methods != option_methods::one) continue;
        if (agreed)
            usage(fmt::format("{} belongs to one method, --method auto agrees over many: leave one of them out",
                              option.typed()));
        if (of_lags)
            usage(fmt::format("{} belongs to the okid and n4sid methods, plscf finds it itself: leave it out",
                              option.typed()));
    }
    if (of_lags && (given.refine == "yes" || !given.sigma_blocks.empty()))
        usage(fmt::format("{} belongs to other methods, found with plscf: leave it out",
                          given.refine == "yes" ? "--refine" : "--sigma-blocks"));
    if (!agreed && given.refine == "auto")
        usage(fmt::format("--refine=auto belongs to --method auto: with {} say yes or no", options.method));
    if (!given.band.empty()) {
        const std::size_t colon = given.band.find(':');
        if (colon == std::string::npos)
            usage(fmt::format("--band: found \"{}\", expected LO:HI in Hz", printable(given.band)));
        options.band = {hertz("--band", given.band.substr(0, colon)), hertz("--band", given.band.substr(colon + 1))};
        if (!(options.band->first < options.band->second))
            usage(fmt::format("--band: found \"{}\", expected the lower frequency first", printable(given.band)));
    }
    options.decimate = whole_of(given, &record_request::decimate).value_or(options.decimate);
    options.threads = whole_of(given, &record_request::threads).value_or(options.threads);
    if (!given.modes.empty()) options.modes = numbers_of("--modes", given.modes);
    if (given.picks.empty()) return;
    if (!given.modes.empty()) usage("--picks and --modes both say which modes are kept: leave one of them out");
    if (given.set_ups) usage("--picks belongs to records, found with --setups");
    options.picks = read_picks(given.picks);
}

} // namespace

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

void check_picked(const std::vector<int>& numbers, std::size_t listed) {
    const int most = numbers.empty() ? 0 : *std::max_element(numbers.begin(), numbers.end());
    if (most > static_cast<int>(listed))
        usage(fmt::format("--modes: found {}, expected numbers of the {} modes listed", most, listed));
}

record_options check_request(const record_request& given) {
    record_options options;
    options.method = chosen_method(given);
    check_words(given);
    check_refine(given);
    const bool agreed = options.method == "auto";
    options.hold = !given.hold.empty() ? given.hold : agreed ? "auto" : "zoh";
    check_agreement(given, options);
    options.p_given = !given.p.empty();
    options.p = whole_of(given, &record_request::p).value_or(options.p);
    options.rows = whole_of(given, &record_request::rows).value_or(options.rows);
    options.order = whole_of(given, &record_request::order).value_or(options.order);
    options.max_order = whole_of(given, &record_request::max_order).value_or(options.max_order);
    options.analytic = given.sigma.empty() ? given.sigma_blocks.empty() : given.sigma == "analytic";
    options.sigma_blocks = whole_of(given, &record_request::sigma_blocks).value_or(options.sigma_blocks);
    if (options.sigma_blocks > 0 && options.sigma_blocks < fewest_blocks)
        usage(fmt::format("--sigma-blocks: found {}, expected 0 (no standard deviations) or {} to {}",
                          options.sigma_blocks, fewest_blocks, most_blocks));
    if (given.sigma == "none") options.sigma_blocks = 0;
    options.stabilization = given.stabilization;
    options.hankel = given.hankel;
    options.refine = !given.refine.empty() ? given.refine : agreed ? "auto" : "no";
    options.detrend = given.detrend;
    options.start = given.start;
    check_channels(given);
    options.inputs = given.inputs;
    options.outputs = given.outputs;
    const bool one_of_all = agreed || options.method == lag_method;
    const std::string fault = one_of_all ? "" : hankel_fault(given.hankel, options.method, options.inputs.size());
    if (!fault.empty()) usage("--hankel: " + fault);
    options.hits = check_hit_dofs(given);
    options.judge_hits = !options.hits.empty();
    options.keep_all_hits = given.keep_all;
    if (given.keep_all && options.hits.empty() && !given.set_ups)
        usage("--keep-all belongs to --hit-dofs, --places and --setups");
    options.sensing = check_sensing(given.sensing.empty() ? "acceleration" : given.sensing, options.outputs.size());
    options.mass = check_dofs(given, options, options.sensing);
    if (!options.hits.empty()) {
        options.placed = options.mass;
        if (!plan_fault(options.placed).empty()) options.mass = {}; // shapes need no force or sensor everywhere
    }
    if (given.set_ups) std::swap(options.placed, options.mass);
    return options;
}

long long whole_number(const std::string& option, const std::string& text, long long low, long long high) {
    long long value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || value < low || value > high)
        usage(
            fmt::format("{}: found \"{}\", expected a whole number from {} to {}", option, printable(text), low, high));
    return value;
}

double check_rate(const std::string& text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !(value > 0) || !std::isfinite(value))
        usage(fmt::format("--fs: found \"{}\", expected a sample rate in Hz above 0", printable(text)));
    return value;
}

void take_record_units(const std::vector<std::string>& units, record_options& options) {
    remark_exchanged(units, options, options.said);
    options.hit_units = units;
    if (options.hits.empty()) {
        for (mass_plan* plan : {&options.mass, &options.placed})
            if (plan->wanted()) take_units(units, *plan, options.said);
        return;
    }
    if (!options.placed.wanted()) return;
    std::vector<std::string> placed = units; // one column a place
    if (!units.empty()) placed.insert(placed.begin(), options.placed.inputs.size() - 1, units[0]);
    take_units(placed, options.placed, options.said);
    if (options.mass.wanted()) options.mass = options.placed;
}

} // namespace okid_host
