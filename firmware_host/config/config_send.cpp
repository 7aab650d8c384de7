// SPDX-License-Identifier: MIT
#include "config_send.hpp"

#include "files/nearest_name.hpp"

#include <drv/candump.h>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int canopen_sync_id = 0x80;
constexpr std::uint32_t largest_base_id = 0x7FF;

/// "123#0011" as cansend takes it.
drv_frame_t parse_frame(const config_place& place, const toml::node& node, const char* key, const std::string& text) {
    static const std::string before = "(0) can0 "; // what stands before the frame in a line of a log
    const std::string line = before + text;
    drv_frame_t frame{};
    drv_candump_error_t why{};
    char interface[DRV_NAME_BYTES];
    if (drv_candump_parse(line.c_str(), line.size(), &frame, interface, &why) != 0)
        refuse_key(place, &node, key,
                   fmt::format("\"{}\", character {}: found \"{}\", expected {}", printable(text),
                               why.column - static_cast<int>(before.size()), why.found, why.expected));
    if (frame.flags & DRV_FRAME_ERROR)
        refuse_key(place, &node, key, fmt::format("\"{}\" is an error message, which cannot be sent", printable(text)));
    return frame;
}

void read_sync(const config_place& place, const toml::table& table, bus_config& bus) {
    const std::int64_t id = table["sync_id"].value_or(std::int64_t{canopen_sync_id});
    const bool extended = static_cast<std::uint32_t>(id) > largest_base_id;
    const toml::node* data = table.get("sync_data");
    bus.sync_frame =
        parse_frame(place, data ? *data : *table.get("sync_hz"), data ? "sync_data" : "sync_hz",
                    fmt::format(extended ? "{:08X}#{}" : "{:03X}#{}", id, table["sync_data"].value_or(std::string())));
}

} // namespace

void read_sending(const config_place& place, const toml::table& table, bus_config& bus) {
    for (const char* key : {"sync_hz", "sync_id", "sync_data", "start"})
        if (bus.type != "socketcan" && table.contains(key))
            refuse_key(place, table.get(key), key,
                       fmt::format("a {} bus sends nothing, a socketcan bus can", bus.type));
    bus.sync_hz = table["sync_hz"].value<double>();
    for (const char* key : {"sync_id", "sync_data"})
        if (!bus.sync_hz && table.contains(key))
            refuse_key(place, table.get(key), key, "\"sync_hz\" is missing: how many SYNC frames a second");
    if (bus.sync_hz) read_sync(place, table, bus);
    const toml::array* start = table["start"].as_array();
    for (std::size_t i = 0; start && i < start->size(); ++i) {
        const auto text = start->get(i)->value<std::string>();
        if (!text || !start->get(i)->is_string())
            refuse_key(
                place, start->get(i), "start",
                fmt::format("found {}, expected frames as text, such as \"000#0100\"", found_value(*start->get(i))));
        bus.start_frames.push_back(parse_frame(place, *start->get(i), "start", *text));
    }
}

} // namespace okid_host
