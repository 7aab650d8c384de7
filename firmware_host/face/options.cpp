// SPDX-License-Identifier: MIT
// PURPOSE  options as JSON to texts
// METHOD   a value becomes what a command line would hold, and is checked where that is: one set of sentences
#include "options.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace okid_host::face {
namespace {

using nlohmann::json;

/// As it would stand on a command line: lists with commas, text without quotes; of a boolean yes or no.
std::string words_of(const json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
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

void take_option(const std::string& key, const json& value, const option_places& to) {
    for (const auto& [name, place] : to.texts)
        if (key == name) return void(*place = words_of(value));
    for (const auto& [name, place] : to.flags)
        if (key == name) return void(*place = flag_of(key, value));
    for (const auto& [name, place] : to.lists)
        if (key == name) return void(*place = names_of(key, value));
    std::vector<std::string> known;
    const auto add = [&](const auto& places) {
        for (const auto& one : places) known.emplace_back(one.first);
    };
    add(to.texts), add(to.flags), add(to.lists);
    throw failure(exit_usage, fmt::format("no option \"{}\"{}, expected one of: {}", printable(key),
                                          did_you_mean(key, known), list_names(known)));
}

} // namespace

option_places places_of(record_request& request, unsigned reach) {
    option_places out;
    for (const identify_option& option : identify_options()) {
        if ((option.reach & reach) != reach) continue;
        const std::string key = option.key();
        if (const auto* text = std::get_if<std::string record_request::*>(&option.place))
            out.texts.emplace_back(key, &(request.**text));
        else if (const auto* flag = std::get_if<bool record_request::*>(&option.place))
            out.flags.emplace_back(key, &(request.**flag));
        else
            out.lists.emplace_back(key, &(request.*std::get<std::vector<std::string> record_request::*>(option.place)));
    }
    return out;
}

void read_options(const char* text, const option_places& to) {
    const json options = json::parse(text, nullptr, false);
    if (!options.is_object()) throw failure(exit_usage, "the options are no JSON object");
    for (const auto& [key, value] : options.items())
        if (!value.is_null()) take_option(key, value, to);
    for (const auto& [name, place] : to.texts)
        if (name == "fs" && place->empty())
            throw failure(exit_usage, "fs is missing, expected a sample rate in Hz above 0");
}

} // namespace okid_host::face
