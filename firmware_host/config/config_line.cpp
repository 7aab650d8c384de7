// SPDX-License-Identifier: MIT
#include "config_line.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <cctype>
#include <drv/line_frame.h>
#include <drv/slcan.h>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int usual_baud = 115200;

/// Keys that mean something only on some types of bus.
struct key_owner {
    const char *key, *types, *expected;
};
constexpr key_owner owners[] = {
    {"device", "serial slcan", "serial or slcan"},
    {"baud", "serial slcan", "serial or slcan"},
    {"framing", "serial", "serial"},
    {"counter_field", "serial", "serial with framing = \"ascii\""},
    {"counter_bits", "serial", "serial with framing = \"ascii\""},
    {"btr", "slcan", "slcan"},
    {"adapter", "socketcan", "socketcan"},
    {"adapter_channel", "socketcan", "socketcan"},
    {"interface", "socketcan replay", "socketcan or replay; a serial line has a device"},
    {"dbc", "socketcan slcan replay", "socketcan, slcan or replay; the channels of a serial bus have a field"},
    {"fd", "socketcan slcan replay", "socketcan, slcan or replay"},
    {"bitrate", "socketcan slcan replay", "socketcan, slcan or replay; a serial line has a baud"},
    {"dbitrate", "socketcan slcan replay", "socketcan, slcan or replay"},
};

void check_owners(const config_place& place, const toml::table& table, const bus_config& bus) {
    for (const key_owner& each : owners)
        if (const toml::node* node = table.get(each.key))
            if ((' ' + std::string(each.types) + ' ').find(' ' + bus.type + ' ') == std::string::npos)
                refuse_key(
                    place, node, each.key,
                    fmt::format("found on a bus of type {}, expected only on one of type {}", bus.type, each.expected));
}

void require(const config_place& place, const toml::table& table, const char* key, const std::string& why) {
    if (!table.contains(key))
        refuse_key(place, &table, key,
                   fmt::format("is missing: a bus of type {} needs {}", table["type"].value_or(std::string()), why));
}

void read_counter(const config_place& place, const toml::table& table, bus_config& bus) {
    const drv_framing_info_t& own = drv_framings[bus.framing];
    bus.counter_bits = table["counter_bits"].value_or(bus.counter_bits);
    const toml::node *field = table.get("counter_field"), *bits = table.get("counter_bits");
    if ((field || bits) && bus.framing != DRV_FRAMING_ASCII)
        refuse_key(place, field ? field : bits, field ? "counter_field" : "counter_bits",
                   fmt::format("only framing = \"ascii\" has it; {} {}", own.name,
                               own.counter_bits ? "counts samples by itself" : "counts none"));
    if (!field) {
        if (bits) refuse_key(place, bits, "counter_bits", "it needs counter_field beside it");
        return;
    }
    bus.counter_field = table["counter_field"].value<int>();
    const auto most = static_cast<int>(own.limit) - 1;
    if (*bus.counter_field > most)
        refuse_key(place, field, "counter_field", fmt::format("found {}, expected 0 to {}", *bus.counter_field, most));
}

void check_rates(const config_place& place, const toml::table& table, const bus_config& bus) {
    char text[64];
    const auto whole = [](const std::optional<double>& rate) { return static_cast<int>(rate.value_or(0)); };
    if (const toml::node* node = table.get("btr"))
        if (bus.btr.size() < 4 || bus.btr.size() > 16 ||
            !std::all_of(bus.btr.begin(), bus.btr.end(), [](unsigned char c) { return std::isxdigit(c); }))
            refuse_key(place, node, "btr",
                       fmt::format("found {}, expected hexadecimal digits as the adapter's manual gives them, such as "
                                   "\"031C\"",
                                   found_value(*node)));
    for (const char* key : {"bitrate", "dbitrate"}) {
        const bool data = key[0] == 'd';
        const toml::node* node = table.get(key);
        if (node && (data || bus.btr.empty()) &&
            drv_slcan_opening(text, sizeof text, data ? 0 : whole(bus.bitrate), data ? whole(bus.dbitrate) : 0,
                              nullptr) < 0)
            refuse_key(place, node, key,
                       fmt::format("found {}, slcan has {}", found_value(*node),
                                   data ? "2000000 and 5000000"
                                        : "10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 and 1000000; "
                                          "btr = \"...\" sets another"));
    }
}

} // namespace

std::vector<std::string> framing_names() {
    std::vector<std::string> out;
    for (const drv_framing_info_t& framing : drv_framings) out.emplace_back(framing.name);
    return out;
}

std::string name_in_logs(const std::string& name) {
    std::string out = name.substr(0, DRV_NAME_BYTES - 1);
    std::replace_if(out.begin(), out.end(), [](unsigned char c) { return c <= ' ' || c > 126; }, '_');
    return out;
}

void read_line(const config_place& place, const toml::table& table, bus_config& bus) {
    check_owners(place, table, bus);
    if (!bus.on_line()) return;
    require(place, table, "device", "one, such as device = \"/dev/serial/by-id/usb-...\"");
    bus.baud = table["baud"].value_or(usual_baud);
    bus.interface = name_in_logs(bus.name);
    if (bus.device.size() >= DRV_PATH_BYTES)
        refuse_key(place, table.get("device"), "device",
                   fmt::format("a device has a path of at most {} characters", int{DRV_PATH_BYTES} - 1));
    if (bus.serial()) {
        require(place, table, "framing", "one of: " + list_names(framing_names()));
        const std::string name = *table["framing"].value<std::string>();
        for (int i = 0; i < DRV_FRAMINGS; ++i)
            if (name == drv_framings[i].name) bus.framing = static_cast<drv_framing_t>(i);
        read_counter(place, table, bus);
    } else {
        bus.btr = table["btr"].value_or(std::string());
        check_rates(place, table, bus);
    }
}

void resolve_field(const config_place& place, const toml::table& table, const bus_config& bus,
                   channel_config& channel) {
    const drv_framing_info_t& own = drv_framings[bus.framing];
    const toml::node* field = table.get("field");
    if (!field)
        refuse_key(place, &table, "field",
                   fmt::format("is missing: bus \"{}\" is serial, expected the number of the channel's place in a "
                               "sample, from 0",
                               bus.name));
    for (const char* key : {"message", "signal", "can_id", "pgn", "source_address", "extended", "start_bit", "length",
                            "byte_order", "signed", "value"})
        if (const toml::node* node = table.get(key))
            refuse_key(place, node, key, "a channel of a serial bus has a field instead");
    if (const toml::node* node = table.get("sequence"))
        refuse_key(place, node, "sequence",
                   own.counter_bits ? fmt::format("framing \"{}\" counts samples by itself", own.name)
                                    : "a serial bus counts samples with counter_field = N in its [[bus]]");
    const auto number = *field->value<std::int64_t>();
    const auto most = static_cast<std::int64_t>(own.limit) - 1;
    if (number > most)
        refuse_key(place, field, "field",
                   fmt::format("found {}, expected 0 to {} with framing \"{}\"", number, most, own.name));
    channel.field = static_cast<unsigned>(number);
    channel.frame = {drv_line_frame_field(bus.framing, *channel.field, &channel.layout), 0, 0};
    channel.length = DRV_LINE_FRAME_BYTES;
    const unsigned bits = own.counter_bits ? own.counter_bits : static_cast<unsigned>(bus.counter_bits);
    if (own.counter_bits || bus.counter_field) drv_line_frame_counter(bits, &channel.sequence.emplace());
    if (channel.unit.empty() && number < 3) channel.unit = own.unit;
}

} // namespace okid_host
