// SPDX-License-Identifier: MIT
#include "presets.hpp"

#include "config_schema.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

/// Every name a section can ask for: "vn100" for a bus, "gsv4.1" for a channel; "" as text of the file that has none.
std::vector<std::string> names_for(bool bus) {
    std::vector<std::string> out;
    for (const auto& [name, text] : preset_files) {
        const toml::table preset = toml::parse(text);
        if (bus && preset.contains("bus")) out.emplace_back(name);
        if (const toml::table* channels = bus ? nullptr : preset["channel"].as_table())
            for (const auto& [channel, keys] : *channels) out.push_back(fmt::format("{}.{}", name, channel.str()));
    }
    return out;
}

/// The second line of a preset file, after that of the licence, says what it is for.
std::string_view purpose_of(std::string_view text) {
    const std::size_t begin = text.find("\n# ") + 3;
    return text.substr(begin, text.find('\n', begin) - begin);
}

/// The keys of a preset; empty when there is no such preset. Its text goes into `texts`, or comes out of them.
toml::table find_preset(const std::string& name, bool bus, std::map<std::string, std::string>& texts) {
    const std::string file = name.substr(0, name.find('.')),
                      channel = name.substr(std::min(name.size(), file.size() + 1));
    if (bus && file != name) return {};
    for (const auto& [known, text] : preset_files)
        if (known == file) texts.emplace(file, text);
    const auto found = texts.find(file);
    if (found == texts.end()) return {};
    try {
        const toml::table preset = parse_toml(found->second);
        const toml::table* keys = bus ? preset["bus"].as_table() : preset["channel"][channel].as_table();
        return keys ? *keys : toml::table{};
    } catch (const toml::parse_error& error) { // one out of a journal
        throw failure(exit_usage, fmt::format("preset \"{}\": line {}: {}", printable(file), error.source().begin.line,
                                              printable(std::string(error.description()), 200)));
    }
}

void apply(const config_place& place, toml::table& entry, bool bus, std::map<std::string, std::string>& texts) {
    const toml::node* node = entry.get("preset");
    if (!node || !node->is_string()) return; // a wrong type is the schema's to refuse
    const std::string name = *node->value<std::string>();
    const toml::table keys = find_preset(name, bus, texts);
    if (keys.empty()) {
        const std::vector<std::string> known = names_for(bus);
        refuse_key(place, node, "preset",
                   fmt::format("found {}{}, expected one of: {} (okid check --presets tells what they are)",
                               found_value(*node), did_you_mean(name, known), list_names(known)));
    }
    for (const auto& [key, value] : keys) entry.insert(key, value); // keeps what is there
}

} // namespace

std::string list_presets() {
    std::string out;
    for (const auto& [name, text] : preset_files) {
        const toml::table preset = toml::parse(text);
        std::vector<std::string> channels;
        if (const toml::table* table = preset["channel"].as_table())
            for (const auto& [channel, keys] : *table) channels.push_back(fmt::format("{}.{}", name, channel.str()));
        out += fmt::format("{:<12} {}\n{:<12} {}{}\n", name, purpose_of(text), "",
                           preset.contains("bus") ? fmt::format("bus: {}; channels: ", name) : "channels: ",
                           fmt::join(channels, ", "));
    }
    return out;
}

void apply_presets(const std::string& path, toml::table& file, std::map<std::string, std::string>& texts) {
    for (const char* section : {"bus", "channel"}) {
        toml::array* entries = file[section].as_array();
        if (!entries) continue;
        for (std::size_t i = 0; i < entries->size(); ++i)
            if (toml::table* entry = entries->get_as<toml::table>(i))
                apply({path, entry_name(section, *entry, i)}, *entry, section[0] == 'b', texts);
    }
}

} // namespace okid_host
