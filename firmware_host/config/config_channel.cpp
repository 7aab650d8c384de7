// SPDX-License-Identifier: MIT
#include "config_channel.hpp"

#include "config_line.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/units.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

[[noreturn]] void refuse_table(const config_place& place, const toml::table& table, const std::string& text) {
    throw failure(exit_usage,
                  fmt::format("{}: line {}, {}: {}", place.path, table.source().begin.line, place.section, text));
}

const dbc_message& find_message(const config_place& place, const toml::node& node, const dbc_file& dbc,
                                const std::string& name) {
    std::vector<std::string> names;
    for (const dbc_message& message : dbc.messages) {
        if (message.name != name && message.long_name != name) {
            if (message.fault.empty()) names.push_back(message.name);
            continue;
        }
        if (message.fault.empty()) return message;
        refuse_key(place, &node, "message",
                   fmt::format("message {} cannot be used: {}", printable(name), message.fault));
    }
    refuse_key(place, &node, "message",
               fmt::format("found \"{}\"{}, expected a message of {}: {}", printable(name), did_you_mean(name, names),
                           dbc.path, list_names(names, 16)));
}

const dbc_signal& find_signal(const config_place& place, const toml::node& node, const char* key, const dbc_file& dbc,
                              const dbc_message& message, const std::string& name) {
    std::vector<std::string> names;
    for (const dbc_signal& signal : message.signals) names.push_back(signal.name);
    for (const dbc_signal& signal : message.signals) {
        if (signal.name != name && signal.long_name != name) continue;
        drv_signal_t layout = signal.layout;
        const char* wrong = drv_signal_prepare(&layout);
        if (!wrong && drv_signal_bytes(&layout) > message.length) wrong = "the signal ends beyond the message";
        if (!wrong && layout.scale == 0) wrong = "the factor of the signal is 0";
        if (wrong)
            refuse_key(place, &node, key,
                       fmt::format("{}: line {}, signal {}: {}", dbc.path, signal.line, name, wrong));
        return signal;
    }
    refuse_key(place, &node, key,
               fmt::format("found \"{}\"{}, expected a signal of message {}: {}", printable(name),
                           did_you_mean(name, names), message.name, list_names(names, 16)));
}

void check_sequence(const config_place& place, const toml::node& node, const drv_signal_t& signal) {
    if (signal.value != DRV_VALUE_INTEGER || signal.is_signed || signal.length < 2 || signal.length > 63)
        refuse_key(place, &node, "sequence", "a counter is an unsigned integer of 2 to 63 bits");
}

/// `sequence = { start_bit = 0, length = 16, byte_order = "little" }`
drv_signal_t sequence_of_table(const config_place& place, const toml::table& table, unsigned message_bytes) {
    drv_signal_t signal{};
    signal.scale = 1;
    const auto whole = [&](const char* key, std::int64_t low, std::int64_t high) {
        const toml::node* node = table.get(key);
        if (!node) refuse_key(place, &table, "sequence", fmt::format("\"{}\" is missing in it", key));
        const auto value = node->value_exact<std::int64_t>();
        if (!value || *value < low || *value > high)
            refuse_key(
                place, node, "sequence",
                fmt::format("{}: found {}, expected a whole number from {} to {}", key, found_value(*node), low, high));
        return static_cast<std::uint16_t>(*value);
    };
    for (const auto& [key, node] : table)
        if (key.str() != "start_bit" && key.str() != "length" && key.str() != "byte_order")
            refuse_key(place, &node, "sequence",
                       fmt::format("unknown \"{}\" in it; known: start_bit, length, byte_order",
                                   printable(std::string(key.str()))));
    signal.start_bit = whole("start_bit", 0, 511);
    signal.length = whole("length", 2, 63);
    const std::string order = table["byte_order"].value_or(std::string("little"));
    if (order != "little" && order != "big" && order != "intel" && order != "motorola")
        refuse_key(place, &table, "sequence",
                   fmt::format("byte_order: found \"{}\", expected little or big", printable(order)));
    signal.big_endian = order == "big" || order == "motorola";
    const char* wrong = drv_signal_prepare(&signal);
    if (!wrong && message_bytes && drv_signal_bytes(&signal) > message_bytes)
        wrong = "the counter ends beyond the message";
    if (wrong) refuse_key(place, &table, "sequence", wrong);
    return signal;
}

/// Frames of a parameter group, whatever their priority and destination, of one sender or of all.
drv_filter_t match_pgn(std::uint32_t number, const std::optional<int>& source) {
    const std::uint32_t group = j1939_group(number), bits = (number >> 8 & 0xFF) < 240 ? 0x03FF0000u : 0x03FFFF00u;
    return {group << 8 | static_cast<std::uint32_t>(source.value_or(0)), 1, bits | (source ? 0xFFu : 0u)};
}

void resolve_sequence(const config_place& place, const toml::table& table, const dbc_file* dbc,
                      const dbc_message* message, channel_config& channel) {
    const toml::node* node = table.get("sequence");
    if (!node) return;
    if (const toml::table* bits = node->as_table()) {
        channel.sequence = sequence_of_table(place, *bits, channel.length);
        return;
    }
    if (!message)
        refuse_key(place, node, "sequence",
                   "the name of a signal needs a channel with message and signal of a dbc; expected { start_bit = 0, "
                   "length = 16 }");
    const dbc_signal& signal = find_signal(place, *node, "sequence", *dbc, *message, *node->value<std::string>());
    channel.sequence = signal.layout;
    check_sequence(place, *node, *channel.sequence);
}

/// The multiplexor of a signal, that one's own, and so on up to one that is always there.
void resolve_selectors(const config_place& place, const toml::node& node, const dbc_file& dbc,
                       const dbc_message& message, const dbc_signal& signal, channel_config& channel) {
    const dbc_signal* inner = &signal;
    while (!inner->mux_values.empty()) {
        const auto outer = std::find_if(message.signals.begin(), message.signals.end(), [&](const dbc_signal& each) {
            return inner->mux_switch.empty() ? each.multiplexor && each.mux_values.empty()
                                             : each.name == inner->mux_switch;
        });
        const char* wrong = outer == message.signals.end()                       ? "has no multiplexor (M)"
                            : channel.selectors.size() == message.signals.size() ? "has multiplexors in a circle"
                                                                                 : nullptr;
        if (wrong)
            refuse_key(place, &node, "signal",
                       fmt::format("{}: line {}: the signal is multiplexed, but message {} {}", dbc.path, inner->line,
                                   message.name, wrong));
        channel.selectors.push_back(
            {find_signal(place, node, "signal", dbc, message, outer->name).layout, inner->mux_values});
        inner = &*outer;
    }
}

/// A DBC with one message of a parameter group means it of every sender; with more than one, their addresses tell them
/// apart. 254 is the address of no sender.
std::optional<int> sender_in(const dbc_file& dbc, const dbc_message& message) {
    const std::uint32_t group = match_pgn(message.id >> 8 & 0x3FFFF, std::nullopt).id, sender = message.id & 0xFF;
    const auto alike = std::count_if(dbc.messages.begin(), dbc.messages.end(), [&](const dbc_message& each) {
        return each.j1939 && match_pgn(each.id >> 8 & 0x3FFFF, std::nullopt).id == group && (each.id & 0xFF) != sender;
    });
    return alike > 0 && sender != 254 ? std::optional<int>(sender) : std::nullopt;
}

void resolve_by_name(const config_place& place, const toml::table& table, const bus_config& bus, const dbc_file* dbc,
                     channel_config& channel) {
    for (const char* key : {"can_id", "pgn", "extended", "start_bit", "length", "byte_order", "signed", "value"})
        if (const toml::node* node = table.get(key))
            refuse_key(place, node, key,
                       "a channel has either message and signal of a dbc, or can_id and start_bit, not both");
    const toml::node *message_node = table.get("message"), *signal_node = table.get("signal");
    if (!message_node || !signal_node)
        refuse_table(place, table,
                     fmt::format("\"{}\" is missing beside \"{}\"", message_node ? "signal" : "message",
                                 message_node ? "message" : "signal"));
    if (!dbc)
        refuse_key(place, message_node, "message",
                   fmt::format("bus \"{}\" has no dbc, expected dbc = \"FILE.dbc\" in its [[bus]]", bus.name));
    channel.message = *message_node->value<std::string>();
    channel.signal = *signal_node->value<std::string>();
    const dbc_message& message = find_message(place, *message_node, *dbc, channel.message);
    const dbc_signal& signal = find_signal(place, *signal_node, "signal", *dbc, message, channel.signal);
    channel.frame = {message.id, static_cast<std::uint8_t>(message.extended), 0};
    const toml::node* source = table.get("source_address");
    if (message.j1939)
        channel.frame = match_pgn(message.id >> 8 & 0x3FFFF, source ? source->value<int>() : sender_in(*dbc, message));
    else if (source)
        refuse_key(place, source, "source_address",
                   fmt::format("message {} is no J1939 message: {} gives it no VFrameFormat J1939PG. Mark it so, or "
                               "leave the key out: its identifier {:#x} is taken as it stands, that of one sender",
                               message.name, dbc->path, message.id));
    channel.length = message.length;
    channel.layout = signal.layout;
    channel.dbc_unit = signal.unit;
    if (channel.unit.empty()) channel.unit = signal.unit;
    resolve_selectors(place, *signal_node, *dbc, message, signal, channel);
    resolve_sequence(place, table, dbc, &message, channel);
}

/// `can_id`, or `pgn` with or without `source_address`.
drv_filter_t identifier_of(const config_place& place, const toml::table& table) {
    const toml::node *pgn = table.get("pgn"), *can_id = table.get("can_id"), *source = table.get("source_address");
    if (pgn) {
        for (const char* key : {"can_id", "extended"})
            if (const toml::node* node = table.get(key))
                refuse_key(place, node, key, "a channel has either can_id or pgn, not both");
        const auto number = static_cast<std::uint32_t>(*pgn->value<std::int64_t>());
        if (number != j1939_group(number))
            refuse_key(place, pgn, "pgn",
                       fmt::format("found {}, expected {}: below 0xF000 the low byte is an address, not part of it",
                                   number, j1939_group(number)));
        return match_pgn(number, table["source_address"].value<int>());
    }
    if (source) refuse_key(place, source, "source_address", "it needs pgn beside it, or a J1939 message of a dbc");
    const auto id = *can_id->value<std::int64_t>();
    const bool extended = table["extended"].value_or(id > 0x7FF);
    if (!extended && id > 0x7FF)
        refuse_key(place, can_id, "can_id", fmt::format("found {}, expected at most 2047 with extended = false", id));
    return {static_cast<std::uint32_t>(id), static_cast<std::uint8_t>(extended), 0};
}

void resolve_by_bits(const config_place& place, const toml::table& table, channel_config& channel) {
    for (const char* key : {"can_id", "start_bit", "length"})
        if (!table.get(key) && !(key[0] == 'c' && table.get("pgn")))
            refuse_table(place, table,
                         fmt::format("\"{}\" is missing: a channel needs message and signal (with a dbc on its bus), "
                                     "or can_id, start_bit and length",
                                     key));
    channel.frame = identifier_of(place, table);
    channel.layout.start_bit = static_cast<std::uint16_t>(*table["start_bit"].value<std::int64_t>());
    channel.layout.length = static_cast<std::uint16_t>(*table["length"].value<std::int64_t>());
    const std::string order = table["byte_order"].value_or(std::string("little"));
    channel.layout.big_endian = order == "big" || order == "motorola";
    channel.layout.is_signed = table["signed"].value_or(false);
    const std::string value = table["value"].value_or(std::string("integer"));
    channel.layout.value = value == "float32"   ? DRV_VALUE_FLOAT32
                           : value == "float64" ? DRV_VALUE_FLOAT64
                                                : DRV_VALUE_INTEGER;
    channel.layout.scale = 1;
    if (const char* wrong = drv_signal_prepare(&channel.layout))
        refuse_key(place, table.get("start_bit"), "start_bit", wrong);
    resolve_sequence(place, table, nullptr, nullptr, channel);
}

} // namespace

std::uint32_t j1939_group(std::uint32_t number) { return (number >> 8 & 0xFF) < 240 ? number & 0x3FF00 : number; }

bool multiplexor::holds(const drv_frame_t& frame) const {
    std::int64_t raw = 0;
    if (!drv_signal_raw(&layout, frame.data, frame.len, &raw)) return false;
    const auto value = static_cast<std::uint64_t>(raw);
    return std::any_of(values.begin(), values.end(),
                       [&](const auto& range) { return value >= range.first && value <= range.second; });
}

bool same_frames(const drv_filter_t& a, const drv_filter_t& b) {
    return a.id == b.id && a.extended == b.extended && a.mask == b.mask;
}

bool same_bits(const drv_signal_t& a, const drv_signal_t& b) {
    return a.start_bit == b.start_bit && a.length == b.length && a.big_endian == b.big_endian;
}

bool multiplexor::operator==(const multiplexor& other) const {
    return same_bits(layout, other.layout) && values == other.values;
}

/// A classic frame has eight bytes; what lies beyond comes in FD frames, which a bus has to be opened for.
static void check_length(const config_place& place, const toml::table& table, const bus_config& bus,
                         const channel_config& channel) {
    const std::size_t bytes = std::max<std::size_t>(channel.length, drv_signal_bytes(&channel.layout));
    const bool can = bus.type == "socketcan" || bus.type == "slcan";
    if (!can || bytes <= (bus.fd ? 64u : 8u)) return;
    if (bytes > 64 || channel.frame.mask)
        refuse_table(place, table,
                     fmt::format("its message has {} bytes, which {}: a transport protocol sends it in pieces, and "
                                 "those are not put together here; take another message",
                                 bytes, bytes > 64 ? "no CAN frame has" : "no J1939 frame has"));
    refuse_table(
        place, table,
        fmt::format("its frame has {} bytes or more, which only CAN FD has: write fd = true in [[bus]] \"{}\", or "
                    "fix the bits of the channel",
                    bytes, bus.name));
}

void resolve_channel(const config_place& place, const toml::table& table, const bus_config& bus, const dbc_file* dbc,
                     channel_config& channel) {
    if (bus.serial())
        resolve_field(place, table, bus, channel);
    else if (const toml::node* node = table.get("field"))
        refuse_key(place, node, "field",
                   fmt::format("bus \"{}\" is of type {}, only a serial bus has fields", bus.name, bus.type));
    else if (table.contains("message") || table.contains("signal"))
        resolve_by_name(place, table, bus, dbc, channel);
    else
        resolve_by_bits(place, table, channel);
    check_length(place, table, bus, channel);
    if (const toml::node* node = table.get("scale")) { // by hand, or to correct what the dbc says
        channel.layout.scale = *node->value<double>();
        if (channel.layout.scale == 0) refuse_key(place, node, "scale", "found 0, expected another number");
    }
    if (const toml::node* node = table.get("offset")) channel.layout.offset = *node->value<double>();
    channel.layout.offset -= table["zero_code"].value_or(0.0) * channel.layout.scale; // offset binary
}

double channel_config::si_factor() const {
    const unit_rule* rule = find_unit(unit);
    return rule ? rule->factor : 1;
}

std::string channel_config::si_unit() const {
    const unit_rule* rule = find_unit(unit);
    return rule ? rule->si : unit;
}

} // namespace okid_host
