// SPDX-License-Identifier: MIT
// One rule a key; the rules of a section stand together in the order of the documentation.
#include "config_schema.hpp"

#include "config_line.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "number_keys.hpp"
#include "record/identify_options.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <tuple>
#include <vector>

namespace okid_host {
namespace {

enum class kind { text, number, positive, whole, flag, choice, order, array, start_bits, line, gpio };

struct key_rule {
    std::string key;
    kind what;
    double low = -std::numeric_limits<double>::infinity();
    double high = std::numeric_limits<double>::infinity();
    std::vector<std::string> choices = {};
};

struct section_rule {
    const char* name;
    bool many; ///< [[name]]
    std::vector<key_rule> keys;
};

/// The keys that are options of `okid identify` too, then those of a stream alone.
std::vector<key_rule> with_options(const std::vector<key_rule>& own) {
    std::vector<key_rule> out;
    for (const identify_option& option : identify_options()) {
        if (!(option.reach & of_configs)) continue;
        const auto low = static_cast<double>(option.low), high = static_cast<double>(option.high);
        std::vector<std::string> choices = option.alternatives();
        choices.erase(std::remove(choices.begin(), choices.end(), lag_method), choices.end()); // of whole records
        switch (option.kind) {
        case option_kind::whole: out.push_back({option.key(), kind::whole, low, high}); break;
        case option_kind::whole_or_auto: out.push_back({option.key(), kind::order, low, high}); break;
        case option_kind::words:
        case option_kind::answer: out.push_back({option.key(), kind::choice, 0, 0, choices}); break;
        default: out.push_back({option.key(), kind::array}); // a band
        }
    }
    out.insert(out.end(), own.begin(), own.end());
    return out;
}

/// One lamp.
const section_rule gpio_rule = {
    "", false, {{"chip", kind::text}, {"line", kind::line, 0, 65535}, {"active_low", kind::flag}}};

const std::vector<section_rule> schema = {
    {"acquisition",
     false,
     {{"rate_hz", kind::number, 1e-5, 1e6}, // a longer period does not fit the nanoseconds of the grid for ever
      {"decimate", kind::whole, 1, 64},
      {"title", kind::text},
      {"operator", kind::text},
      {"structure", kind::text},
      {"specimen", kind::text},
      {"location", kind::text},
      {"notes", kind::text}}},
    {"bus",
     true,
     {{"name", kind::text},
      {"preset", kind::text},
      {"type", kind::choice, 0, 0, {"socketcan", "slcan", "serial", "replay"}},
      {"interface", kind::text},
      {"adapter", kind::text},
      {"adapter_channel", kind::whole, 0, 31},
      {"device", kind::text},
      {"baud", kind::whole, 50, 2e7},
      {"framing", kind::choice, 0, 0, framing_names()},
      {"counter_field", kind::whole, 0, 1023},
      {"counter_bits", kind::whole, 2, 32},
      {"btr", kind::text},
      {"clock", kind::choice, 0, 0, {"shared", "free"}},
      {"rate_hz", kind::positive, 0, 1e6},
      {"file", kind::text},
      {"fd", kind::flag},
      {"bitrate", kind::whole, 1000, 2e7},
      {"dbitrate", kind::whole, 1000, 2e7},
      {"dbc", kind::text},
      {"sync_hz", kind::positive, 0, 1e4},
      {"sync_id", kind::whole, 0, 0x1FFFFFFF},
      {"sync_data", kind::text},
      {"start", kind::array}}},
    {"channel",
     true,
     {{"name", kind::text},
      {"preset", kind::text},
      {"role", kind::choice, 0, 0, {"force", "acceleration", "velocity", "displacement", "aux"}},
      {"dof", kind::whole, 1, 100000},
      {"unit", kind::text},
      {"bus", kind::text},
      {"message", kind::text},
      {"signal", kind::text},
      {"can_id", kind::whole, 0, 0x1FFFFFFF},
      {"pgn", kind::whole, 0, 0x3FFFF},
      {"source_address", kind::whole, 0, 255},
      {"extended", kind::flag},
      {"start_bit", kind::whole, 0, 511},
      {"length", kind::whole, 1, 64},
      {"byte_order", kind::choice, 0, 0, {"little", "big", "intel", "motorola"}},
      {"signed", kind::flag},
      {"value", kind::choice, 0, 0, {"integer", "float32", "float64"}},
      {"scale", kind::number},
      {"offset", kind::number},
      {"zero_code", kind::number},
      {"field", kind::whole, 0, 1023},
      {"sequence", kind::start_bits}}},
    {"identification", false,
     with_options({{"window_s", kind::positive, 0, 1e6},
                   {"window", kind::choice, 0, 0, {"fixed", "auto"}},
                   {"forgetting", kind::positive, 0, 1},
                   {"update_s", kind::positive, 0, 1e5},
                   {"restart_on_change", kind::flag},
                   {"mkr", kind::flag},
                   {"max_memory_mb", kind::positive, 0, 1e6}})},
    {"alarm",
     false,
     {{"enabled", kind::flag},
      {"k_sigma", kind::positive, 0, 1e6},
      {"baseline_updates", kind::whole, 1, 1000000},
      {"test_s", kind::positive, 0, 1e7},
      {"test_rows", kind::whole, 2, 512},
      {"false_alarm", kind::positive, 0, 0.5},
      {"command", kind::text}}},
    {"trigger",
     false,
     {{"source", kind::choice, 0, 0, {"immediate", "level", "gpio"}},
      {"channel", kind::text},
      {"level", kind::number},
      {"pretrigger_s", kind::number, 0, 1e5},
      {"chip", kind::text},
      {"line", kind::line, 0, 65535},
      {"active_low", kind::flag},
      {"edge", kind::choice, 0, 0, {"rising", "falling", "both"}}}},
    {"hammer",
     false,
     {{"channel", kind::text},
      {"level", kind::number},
      {"hits", kind::whole, 1, 1000},
      {"points", kind::array},
      {"length_s", kind::positive, 0, 1e4},
      {"pretrigger_s", kind::number, 0, 1e4},
      {"double_percent", kind::positive, 0, 100},
      {"spectrum_hz", kind::positive, 0, 1e6}}},
    {"lamps", false, {{"armed", kind::gpio}, {"go", kind::gpio}, {"alarm", kind::gpio}}},
    {"record",
     false,
     {{"directory", kind::text},
      {"segment_mb", kind::positive, 0, 1e6},
      {"max_mb", kind::positive, 0, 1e9},
      {"pretrigger_s", kind::number, 0, 1e5}}},
    {"publish",
     false,
     {{"socket", kind::text},
      {"samples", kind::flag},
      {"udp", kind::text},
      {"prometheus", kind::text},
      {"mqtt", kind::text},
      {"password_file", kind::text},
      {"discovery", kind::flag},
      {"influx", kind::text},
      {"influx_token_file", kind::text}}},
    {"virtual", false, {{"model", kind::text}, {"channels", kind::array}}},
    {"realtime", false, {{"priority", kind::whole, 0, 99}, {"lock_memory", kind::flag}, {"cpus", kind::array}}},
    {"geometry",
     false,
     {{"nodes", kind::array},
      {"dofs", kind::array},
      {"lines", kind::array},
      {"surfaces", kind::array},
      {"fixed", kind::array}}}};

void check_number(const config_place& place, const toml::node& node, const key_rule& rule) {
    const bool whole = rule.what == kind::whole;
    const auto value = node.value<double>();
    const bool fits = whole ? node.is_integer() : node.is_number();
    if (fits && value && std::isfinite(*value) && *value >= rule.low && *value <= rule.high &&
        (rule.what != kind::positive || *value > rule.low))
        return;
    std::string expected = whole ? "a whole number" : "a number";
    if (rule.what == kind::positive)
        expected += fmt::format(" above {:.10g}", rule.low);
    else if (std::isfinite(rule.low))
        expected += fmt::format(" from {:.10g}", rule.low);
    if (std::isfinite(rule.high)) expected += fmt::format(" to {:.10g}", rule.high);
    refuse_key(place, &node, rule.key, fmt::format("found {}, expected {}", found_value(node), expected));
}

void check_choice(const config_place& place, const toml::node& node, const key_rule& rule) {
    const auto text = node.value<std::string>();
    if (text && std::find(rule.choices.begin(), rule.choices.end(), *text) != rule.choices.end()) return;
    refuse_key(place, &node, rule.key,
               fmt::format("found {}{}, expected one of: {}", found_value(node),
                           text ? did_you_mean(*text, rule.choices) : "", list_names(rule.choices)));
}

void check_table(const config_place& place, const toml::table& table, const section_rule& rule);

void check_value(const config_place& place, const toml::node& node, const key_rule& rule) {
    const auto expect = [&](bool holds, const char* expected) {
        if (!holds)
            refuse_key(place, &node, rule.key, fmt::format("found {}, expected {}", found_value(node), expected));
    };
    switch (rule.what) {
    case kind::text: expect(node.is_string() && !node.value<std::string>()->empty(), "text in quotes"); break;
    case kind::flag: expect(node.is_boolean(), "true or false"); break;
    case kind::array: expect(node.is_array(), "an array"); break;
    case kind::start_bits:
        expect((node.is_string() && !node.value<std::string>()->empty()) || node.is_table(),
               "the name of a signal or { start_bit = 0, length = 16 }");
        break;
    case kind::order:
        if (node.value<std::string>() != "auto") {
            expect(node.is_integer(), "\"auto\" or a whole number");
            check_number(place, node, {rule.key, kind::whole, rule.low, rule.high});
        }
        break;
    case kind::line:
        if (!node.is_string() || node.value<std::string>()->empty()) {
            expect(node.is_integer(), "the number of a line on its chip or its name in quotes");
            check_number(place, node, {rule.key, kind::whole, rule.low, rule.high});
        }
        break;
    case kind::gpio:
        expect(node.is_table(), "a GPIO line, such as { chip = \"gpiochip0\", line = 17 }");
        check_table({place.path, fmt::format("{} {}", place.section, rule.key)}, *node.as_table(), gpio_rule);
        break;
    case kind::choice: check_choice(place, node, rule); break;
    default: check_number(place, node, rule);
    }
}

using table_entry = std::pair<std::string_view, const toml::node*>;

/// The entries of a table in the order of the file, so that the first fault is the one reported.
std::vector<table_entry> in_order(const toml::table& table) {
    std::vector<table_entry> out;
    for (const auto& [key, node] : table) out.emplace_back(key.str(), &node);
    std::sort(out.begin(), out.end(), [](const table_entry& a, const table_entry& b) {
        const toml::source_position at = a.second->source().begin, other = b.second->source().begin;
        return std::tie(at.line, at.column, a.first) < std::tie(other.line, other.column, b.first);
    });
    return out;
}

void check_table(const config_place& place, const toml::table& table, const section_rule& rule) {
    std::vector<std::string> known;
    for (const key_rule& key : rule.keys) known.push_back(key.key);
    for (const auto& [key, node] : in_order(table)) {
        const std::string name(key);
        const auto found =
            std::find_if(rule.keys.begin(), rule.keys.end(), [&](const key_rule& k) { return name == k.key; });
        if (found == rule.keys.end())
            refuse_key(place, node, key,
                       fmt::format("unknown key{}; known here: {}", did_you_mean(name, known), list_names(known)));
        check_value(place, *node, *found);
    }
}

void check_section(const std::string& path, std::string_view key, const toml::node& node) {
    const auto& rules = schema;
    const auto rule = std::find_if(rules.begin(), rules.end(), [&](const section_rule& r) { return key == r.name; });
    const config_place top{path, "top level"};
    if (rule == rules.end()) {
        std::vector<std::string> known;
        for (const section_rule& each : rules) known.emplace_back(each.name);
        refuse_key(top, &node, key,
                   fmt::format("unknown {}{}; known: {}", node.is_table() || node.is_array() ? "section" : "key",
                               did_you_mean(std::string(key), known), list_names(known)));
    }
    if (!rule->many) {
        if (!node.is_table())
            refuse_key(top, &node, key, fmt::format("found {}, expected a section [{}]", found_value(node), key));
        check_table({path, fmt::format("[{}]", key)}, *node.as_table(), *rule);
        return;
    }
    const toml::array* entries = node.as_array();
    if (!entries || !entries->is_homogeneous(toml::node_type::table))
        refuse_key(top, &node, key,
                   fmt::format("found {}, expected sections [[{}]] with two brackets", found_value(node), key));
    for (std::size_t i = 0; i < entries->size(); ++i)
        check_table({path, entry_name(rule->name, *entries->get_as<toml::table>(i), i)},
                    *entries->get_as<toml::table>(i), *rule);
}

} // namespace

void refuse_key(const config_place& place, const toml::node* node, std::string_view key, const std::string& text) {
    std::string at; // a key that is not in the file has no place there, one taken over from a preset no line
    if (node)
        at = node->source().begin.line ? fmt::format("line {}, ", node->source().begin.line) : "from the preset, ";
    throw failure(exit_usage, fmt::format("{}: {}{}, key \"{}\": {}", place.path, at, place.section,
                                          printable(std::string(key)), text));
}

std::vector<number_key> number_keys() {
    std::vector<number_key> out;
    for (const section_rule& section : schema)
        for (const key_rule& rule : section.keys)
            if (std::isfinite(rule.high) && rule.high > rule.low)
                out.push_back({section.name, rule.key.c_str(), section.many, rule.low, rule.high});
            else if (rule.what == kind::number)
                out.push_back({section.name, rule.key.c_str(), section.many, -1, 1});
    return out;
}

std::string found_value(const toml::node& node) {
    if (const auto text = node.value<std::string>(); text && node.is_string()) return '"' + printable(*text) + '"';
    if (const auto flag = node.as_boolean()) return flag->get() ? "true" : "false";
    if (const auto whole = node.as_integer()) return std::to_string(whole->get());
    if (const auto number = node.as_floating_point()) return fmt::format("{:g}", number->get());
    if (node.is_table()) return "a table";
    return node.is_array() ? "an array" : "a date or time";
}

std::string entry_name(const char* section, const toml::table& entry, std::size_t index) {
    const auto name = entry["name"].value<std::string>();
    return name ? fmt::format("[[{}]] \"{}\"", section, printable(*name))
                : fmt::format("[[{}]] number {}", section, index + 1);
}

void check_schema(const std::string& path, const toml::table& file) {
    for (const auto& [key, node] : in_order(file)) check_section(path, key, *node);
}

} // namespace okid_host
