// SPDX-License-Identifier: MIT
#include "config_trigger.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double most_pretrigger_bytes = 1e9;

[[noreturn]] void missing_key(const config_place& place, const toml::table& table, const char* key, const char* why) {
    throw failure(exit_usage, fmt::format("{}: line {}, {}: \"{}\" is missing: {}", place.path,
                                          table.source().begin.line, place.section, key, why));
}

/// chip, line and active_low out of a table.
gpio_place read_place(const config_place& place, const toml::table& table) {
    for (const char* key : {"chip", "line"})
        if (!table.contains(key))
            missing_key(place, table, key,
                        key[0] == 'c' ? "a GPIO line is on a chip, such as chip = \"gpiochip0\" (gpiodetect lists them)"
                                      : "the number or the name of the line, such as line = 17 (gpioinfo lists them)");
    gpio_place out;
    out.chip = *table["chip"].value<std::string>();
    out.name = table["line"].value_or(std::string());
    out.offset = static_cast<int>(table["line"].value_or(std::int64_t{0}));
    out.active_low = table["active_low"].value_or(false);
    for (const char* key : {"chip", "line"})
        if (const std::string text = table[key].value_or(std::string()); text.size() >= DRV_GPIO_NAME_BYTES)
            refuse_key(place, table.get(key), key, "expected at most 63 characters");
    return out;
}

/// Keys that belong to another source mislead.
void refuse_others(const config_place& place, const toml::table& table, const std::string& source) {
    const auto refuse = [&](std::initializer_list<const char*> keys, const char* owner) {
        for (const char* key : keys)
            if (table.contains(key))
                refuse_key(place, table.get(key), key,
                           fmt::format("belongs to source = \"{}\", found source = \"{}\"", owner, source));
    };
    if (source != "gpio") refuse({"chip", "line", "active_low"}, "gpio");
    if (source != "level") refuse({"channel", "level"}, "level");
    if (source == "immediate") refuse({"edge", "pretrigger_s"}, "gpio\" or \"level");
}

void read_start(const toml::table& file, live_config& config) {
    const toml::table* table = file["trigger"].as_table();
    if (!table) return;
    const config_place place{config.path, "[trigger]"};
    const std::string source = (*table)["source"].value_or(std::string("immediate"));
    refuse_others(place, *table, source);
    trigger_config& out = config.trigger;
    const std::string edge = (*table)["edge"].value_or(std::string("rising"));
    out.edge = edge == "rising" ? DRV_GPIO_RISING : edge == "falling" ? DRV_GPIO_FALLING : DRV_GPIO_BOTH;
    out.pretrigger_s = (*table)["pretrigger_s"].value_or(0.0);
    if (const double bytes = out.pretrigger_s * config.rate_hz * 8 * static_cast<double>(config.channels.size() + 4);
        bytes > most_pretrigger_bytes)
        refuse_key(place, table->get("pretrigger_s"), "pretrigger_s",
                   fmt::format("{:g} s of {} channels at {:g} Hz are {:.1f} GB, at most {:g} GB are kept",
                               out.pretrigger_s, config.channels.size(), config.rate_hz, bytes / 1e9,
                               most_pretrigger_bytes / 1e9));
    if (source == "gpio") {
        out.source = trigger_source::gpio;
        out.place = read_place(place, *table);
    } else if (source == "level") {
        out.source = trigger_source::level;
        if (!table->contains("level"))
            missing_key(place, *table, "level",
                        "the value whose crossing starts the identification, in the "
                        "channel's unit");
        out.level = *(*table)["level"].value<double>();
        out.channel = triggering_channel(place, *table, config);
    }
}

void read_lamps(const toml::table& file, live_config& config) {
    const toml::table* table = file["lamps"].as_table();
    if (!table) return;
    const std::pair<const char*, std::optional<gpio_place>*> lamps[] = {
        {"armed", &config.lamps.armed}, {"go", &config.lamps.go}, {"alarm", &config.lamps.alarm}};
    std::vector<std::string> taken;
    if (config.trigger.source == trigger_source::gpio) taken.push_back(config.trigger.place.text());
    for (const auto& [key, lamp] : lamps) {
        const toml::table* one = (*table)[key].as_table();
        if (!one) continue;
        *lamp = read_place({config.path, fmt::format("[lamps] {}", key)}, *one);
        if (std::find(taken.begin(), taken.end(), (*lamp)->text()) != taken.end())
            refuse_key({config.path, "[lamps]"}, one, key,
                       fmt::format("{} is used already, by another lamp or the trigger", (*lamp)->text()));
        taken.push_back((*lamp)->text());
    }
}

} // namespace

std::size_t triggering_channel(const config_place& place, const toml::table& table, const live_config& config) {
    std::vector<std::string> names;
    for (const channel_config& channel : config.channels) names.push_back(channel.name);
    const toml::node* node = table.get("channel");
    if (!node) {
        if (config.n_u > 0) return 0; // the first force
        missing_key(place, table, "channel", "there is no force, so say which channel triggers");
    }
    const std::string name = *node->value<std::string>();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
        refuse_key(place, node, "channel",
                   fmt::format("found \"{}\"{}, expected one of: {}", printable(name), did_you_mean(name, names),
                               list_names(names)));
    return static_cast<std::size_t>(found - names.begin());
}

drv_gpio_config_t gpio_place::driver() const {
    drv_gpio_config_t out{};
    out.chip = chip.c_str();
    out.line = name.empty() ? nullptr : name.c_str();
    out.offset = offset;
    out.active_low = active_low;
    return out;
}

void read_trigger(const toml::table& file, live_config& config) {
    read_start(file, config);
    read_lamps(file, config);
}

} // namespace okid_host
