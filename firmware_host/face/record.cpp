// SPDX-License-Identifier: MIT
// PURPOSE  records in the memory of a caller to a result
// METHOD   the options of a JSON object become the text a command line would have, and are checked where that is
#include "guard.hpp"
#include "result_handle.hpp"

#include "config/nearest_name.hpp"
#include "record/csv_header.hpp"
#include "record/request.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <utility>

namespace okid_host::face {
namespace {

using nlohmann::json;

/// As it would stand on a command line: lists with commas, text without quotes.
std::string words_of(const json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (!value.is_array()) return value.dump();
    std::string out;
    for (const json& one : value) out += (&one == &value.front() ? "" : ",") + words_of(one);
    return out;
}

std::vector<std::string> names_of(const std::string& key, const json& value) {
    std::vector<std::string> out;
    if (!value.is_array()) throw failure(exit_usage, fmt::format("{}: found {}, expected a list", key, value.dump()));
    for (const json& one : value) out.push_back(words_of(one));
    return out;
}

bool flag_of(const std::string& key, const json& value) {
    if (!value.is_boolean())
        throw failure(exit_usage, fmt::format("{}: found {}, expected true or false", key, value.dump()));
    return value.get<bool>();
}

struct asked {
    record_request request;
    std::vector<std::string> units;
};

void take_option(const std::string& key, const json& value, asked& to) {
    record_request& r = to.request;
    const std::pair<const char*, std::string*> texts[] = {{"fs", &r.fs},
                                                          {"method", &r.method},
                                                          {"p", &r.p},
                                                          {"rows", &r.rows},
                                                          {"order", &r.order},
                                                          {"max_order", &r.max_order},
                                                          {"hankel", &r.hankel},
                                                          {"hold", &r.hold},
                                                          {"detrend", &r.detrend},
                                                          {"start", &r.start},
                                                          {"sensing", &r.sensing},
                                                          {"input_dofs", &r.input_dofs},
                                                          {"output_dofs", &r.output_dofs},
                                                          {"sigma_blocks", &r.sigma_blocks}};
    const std::pair<const char*, bool*> flags[] = {{"refine", &r.refine}, {"stabilization", &r.stabilization}};
    const std::pair<const char*, std::vector<std::string>*> lists[] = {
        {"inputs", &r.inputs}, {"outputs", &r.outputs}, {"units", &to.units}};
    std::vector<std::string> known;
    for (const auto& [name, place] : texts) {
        known.emplace_back(name);
        if (key == name) return void(*place = words_of(value));
    }
    for (const auto& [name, place] : flags) {
        known.emplace_back(name);
        if (key == name) return void(*place = flag_of(key, value));
    }
    for (const auto& [name, place] : lists) {
        known.emplace_back(name);
        if (key == name) return void(*place = names_of(key, value));
    }
    throw failure(exit_usage, fmt::format("no option \"{}\"{}, expected one of: {}", printable(key),
                                          did_you_mean(key, known), list_names(known)));
}

asked read_options(const char* text) {
    const json options = json::parse(text, nullptr, false);
    if (!options.is_object()) throw failure(exit_usage, "the options are no JSON object");
    asked out;
    for (const auto& [key, value] : options.items())
        if (!value.is_null()) take_option(key, value, out);
    if (out.request.fs.empty()) throw failure(exit_usage, "fs is missing, expected a sample rate in Hz above 0");
    return out;
}

record_options checked(const asked& given) {
    record_options options = check_request(given.request);
    options.fs_hz = check_rate(given.request.fs);
    std::vector<std::string> units = given.units;
    if (units.empty())
        for (const auto* side : {&options.inputs, &options.outputs})
            for (const std::string& name : *side) units.push_back(unit_of_name(name));
    if (units.size() != options.inputs.size() + options.outputs.size())
        throw failure(exit_usage, fmt::format("units: found {} for {} channels, expected one for each", units.size(),
                                              options.inputs.size() + options.outputs.size()));
    take_record_units(units, options);
    return options;
}

} // namespace
} // namespace okid_host::face

using namespace okid_host;

int32_t okid_host_identify(const char* options, int32_t records, const double* const* samples, const size_t* counts,
                           const char* const* names, okid_host_stage_t stage, void* context,
                           okid_host_result_t** result) {
    *result = nullptr;
    return face::guard([&] {
        record_options wanted = face::checked(face::read_options(options));
        if (stage) wanted.stage = [&](const char* text) { stage(context, text); };
        record_set set;
        set.n_u = wanted.inputs.size();
        set.n_y = wanted.outputs.size();
        std::size_t total = 0;
        for (int32_t i = 0; i < records; ++i) total += counts[i];
        set.samples.reserve(total * set.channels());
        for (int32_t i = 0; i < records; ++i) set.add(names[i], samples[i], counts[i]);
        *result = face::make_result(identify_records(std::move(set), wanted));
    });
}
