// SPDX-License-Identifier: MIT
#include "presets.hpp"

#include "config_schema.hpp"
#include "nearest_name.hpp"

#include <fmt/format.h>

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

/// The keys of a preset; empty when there is no such preset.
toml::table find_preset(const std::string& name, bool bus) {
    const std::string file = name.substr(0, name.find('.')),
                      channel = name.substr(std::min(name.size(), file.size() + 1));
    for (const auto& [known, text] : preset_files) {
        if (known != file || (bus && file != name)) continue;
        const toml::table preset = toml::parse(text);
        const toml::table* keys = bus ? preset["bus"].as_table() : preset["channel"][channel].as_table();
        if (keys) return *keys;
    }
    return {};
}

void apply(const config_place& place, toml::table& entry, bool bus) {
    const toml::node* node = entry.get("preset");
    if (!node || !node->is_string()) return; // a wrong type is the schema's to refuse
    const std::string name = *node->value<std::string>();
    const toml::table keys = find_preset(name, bus);
    if (keys.empty()) {
        const std::vector<std::string> known = names_for(bus);
        refuse_key(place, *node, "preset",
                   fmt::format("found {}{}, expected one of: {}", found_value(*node), did_you_mean(name, known),
                               list_names(known)));
    }
    for (const auto& [key, value] : keys) entry.insert(key, value); // keeps what is there
}

} // namespace

void apply_presets(const std::string& path, toml::table& file) {
    for (const char* section : {"bus", "channel"}) {
        toml::array* entries = file[section].as_array();
        if (!entries) continue;
        for (std::size_t i = 0; i < entries->size(); ++i)
            if (toml::table* entry = entries->get_as<toml::table>(i))
                apply({path, entry_name(section, *entry, i)}, *entry, section[0] == 'b');
    }
}

} // namespace okid_host
