// SPDX-License-Identifier: MIT
// PURPOSE  checks what a user asks of an identification, for the program and for other languages
// METHOD   everything comes as text, so that the same words answer the same mistake wherever it is made
#include "request.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"
#include "record_check.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

[[noreturn]] void usage(const std::string& text) { throw failure(exit_usage, text); }

void one_of(const std::string& option, const std::string& value, const std::vector<std::string>& choices) {
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return;
    usage(fmt::format("{}: found \"{}\"{}, expected one of: {}", option, printable(value), did_you_mean(value, choices),
                      list_names(choices)));
}

void check_refine(const record_request& given) {
    if (given.refine && given.inputs.empty())
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
mass_plan check_dofs(const record_request& given, const record_options& options, const std::vector<int>& sensing) {
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

} // namespace

record_options check_request(const record_request& given) {
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
    if (!given.max_order.empty())
        options.max_order = static_cast<int>(whole_number("--max-order", given.max_order, 1, 10000));
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
    check_channels(given);
    options.inputs = given.inputs;
    options.outputs = given.outputs;
    if (const std::string fault = hankel_fault(given.hankel, given.method, options.inputs.size()); !fault.empty())
        usage("--hankel: " + fault);
    options.mass = check_dofs(given, options, check_sensing(given.sensing, options.outputs.size()));
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
    if (options.mass.wanted()) take_units(units, options.mass, options.said);
}

} // namespace okid_host
