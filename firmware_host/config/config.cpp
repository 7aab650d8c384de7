// SPDX-License-Identifier: MIT
#include "config.hpp"

#include "config_alarm.hpp"
#include "config_channel.hpp"
#include "config_clock.hpp"
#include "config_geometry.hpp"
#include "config_hammer.hpp"
#include "config_identification.hpp"
#include "config_line.hpp"
#include "config_publish.hpp"
#include "config_realtime.hpp"
#include "config_record.hpp"
#include "config_schema.hpp"
#include "config_send.hpp"
#include "config_trigger.hpp"
#include "error.hpp"
#include "files/file_kind.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "files/units.hpp"
#include "presets.hpp"
#include "secrets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <unordered_map>
#include <unordered_set>

namespace okid_host {
namespace {

[[noreturn]] void refuse_file(const std::string& path, const std::string& text) {
    throw failure(exit_usage, fmt::format("{}: {}", path, text));
}

[[noreturn]] void refuse_entry(const config_place& place, const toml::table& table, const std::string& text) {
    refuse_file(place.path, fmt::format("line {}, {}: {}", table.source().begin.line, place.section, text));
}

toml::table parse(const std::string& path, const std::string& text) {
    try {
        return parse_toml(text, path);
    } catch (const toml::parse_error& error) {
        const file_kind kind = kind_of_text(text);
        if (kind != file_kind::unknown && kind != file_kind::toml)
            refuse_file(path, fmt::format("it looks like {}, expected a CONFIG.toml (see okid COMMAND --help for the "
                                          "order of the files)",
                                          file_kind_name(kind)));
        refuse_file(path, fmt::format("line {}, column {}: {}", error.source().begin.line, error.source().begin.column,
                                      printable(std::string(error.description()), 200)));
    }
}

std::string beside(const std::string& config, const std::string& file) {
    const std::filesystem::path path(file);
    return path.is_absolute() ? file : (std::filesystem::path(config).parent_path() / path).string();
}

void require_key(const config_place& place, const toml::table& table, const char* key, const char* why) {
    if (!table.contains(key)) refuse_entry(place, table, fmt::format("\"{}\" is missing: {}", key, why));
}

/// An interface by its name, or that of an adapter, whose name may change.
void read_adapter(const config_place& place, const toml::table& table, bus_config& bus) {
    const toml::node* adapter = table.get("adapter");
    const toml::node* channel = table.get("adapter_channel");
    if (!adapter) {
        require_key(place, table, "interface",
                    "a socketcan bus needs one, such as interface = \"can0\", or the serial number of a USB adapter: "
                    "adapter = \"...\"");
        if (channel) refuse_key(place, channel, "adapter_channel", "it needs adapter beside it");
        return;
    }
    if (const toml::node* name = table.get("interface"))
        refuse_key(place, name, "interface", "adapter stands beside it: one of the two");
    bus.adapter = *table["adapter"].value<std::string>();
    bus.adapter_channel = table["adapter_channel"].value_or(0);
    bus.interface = name_in_logs(bus.name);
    if (bus.adapter.size() >= sizeof drv_usb_t::serial)
        refuse_key(place, adapter, "adapter", "a serial number or a port has at most 127 characters");
}

bus_config read_bus(const config_place& place, const toml::table& table) {
    bus_config bus;
    require_key(place, table, "name", "every bus has a name");
    bus.name = *table["name"].value<std::string>();
    bus.type = table["type"].value_or(bus.type);
    bus.interface = table["interface"].value_or(std::string());
    bus.device = table["device"].value_or(std::string());
    bus.fd = table["fd"].value_or(false);
    bus.bitrate = table["bitrate"].value<double>();
    bus.dbitrate = table["dbitrate"].value<double>();
    bus.dbc_name = table["dbc"].value_or(std::string());
    if (!bus.dbc_name.empty()) bus.dbc = beside(place.path, bus.dbc_name);
    if (const auto file = table["file"].value<std::string>()) {
        if (bus.type != "replay")
            refuse_key(place, table.get("file"), "file",
                       fmt::format("only a bus of type replay reads a file, this one is of type {}", bus.type));
        bus.file = beside(place.path, *file);
    }
    read_line(place, table, bus);
    read_sending(place, table, bus);
    if (bus.type == "socketcan") read_adapter(place, table, bus);
    if (bus.type == "replay") require_key(place, table, "file", "a replay bus needs a candump -L log");
    if (bus.interface.size() >= DRV_NAME_BYTES)
        refuse_key(place, table.get("interface"), "interface", "an interface name has at most 15 characters");
    return bus;
}

void read_acquisition(const std::string& path, const toml::table& file, live_config& config) {
    const toml::table* table = file["acquisition"].as_table();
    if (!table || !table->contains("rate_hz"))
        refuse_file(path,
                    "\"rate_hz\" is missing in [acquisition], expected the sample rate, such as rate_hz = 1000.0");
    config.rate_hz = *(*table)["rate_hz"].value<double>();
    for (const auto& [key, node] : *table)
        if (node.is_string()) config.notes.emplace_back(key.str(), *node.value<std::string>());
}

void read_buses(const std::string& path, const toml::table& file, live_config& config) {
    const toml::array* entries = file["bus"].as_array();
    if (!entries || entries->empty()) refuse_file(path, "no [[bus]], expected at least one");
    if (entries->size() > DRV_MAX_BUSES)
        refuse_file(path, fmt::format("{} buses, at most {} are possible", entries->size(), int{DRV_MAX_BUSES}));
    for (std::size_t i = 0; i < entries->size(); ++i) {
        const toml::table& table = *entries->get_as<toml::table>(i);
        const config_place place{path, entry_name("bus", table, i)};
        bus_config bus = read_bus(place, table);
        for (const bus_config& other : config.buses) {
            if (other.name == bus.name) refuse_key(place, table.get("name"), "name", "another [[bus]] has this name");
            for (const char* key : {"interface", "device"}) {
                const auto mine = table[key].value<std::string>();
                if (mine && *mine == (key[0] == 'i' ? other.interface : other.device))
                    refuse_key(place, table.get(key), key, fmt::format("bus \"{}\" uses it already", other.name));
            }
            if (!bus.adapter.empty() && other.adapter == bus.adapter && other.adapter_channel == bus.adapter_channel)
                refuse_key(place, table.get("adapter"), "adapter",
                           fmt::format("bus \"{}\" uses this channel of it already", other.name));
            if ((bus.on_line() || !bus.adapter.empty()) && other.interface == bus.interface)
                refuse_key(place, table.get("name"), "name",
                           fmt::format("\"{}\" would stand for two buses in a log", bus.interface));
        }
        config.buses.push_back(std::move(bus));
    }
}

constexpr std::array<const char*, 5> role_names{"force", "acceleration", "velocity", "displacement", "aux"};

channel_role role_of(const std::string& text) {
    const auto at = std::find(role_names.begin(), role_names.end(), text);
    return at == role_names.end() ? channel_role::aux : static_cast<channel_role>(at - role_names.begin());
}

std::size_t bus_of(const config_place& place, const toml::table& table, const live_config& config) {
    std::vector<std::string> names;
    for (const bus_config& bus : config.buses) names.push_back(bus.name);
    const toml::node* node = table.get("bus");
    if (!node) {
        if (names.size() == 1) return 0;
        refuse_entry(place, table, fmt::format("\"bus\" is missing, expected one of: {}", list_names(names)));
    }
    const std::string name = *node->value<std::string>();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
        refuse_key(place, node, "bus",
                   fmt::format("found \"{}\"{}, expected one of: {}", printable(name), did_you_mean(name, names),
                               list_names(names)));
    return static_cast<std::size_t>(found - names.begin());
}

/// The channels that came before, so that each is compared with few.
struct known_channels {
    struct message {
        std::vector<std::size_t> channels;
        std::optional<std::size_t> counted; ///< one whose counter is that of all
    };
    std::unordered_set<std::string> names;
    std::unordered_map<std::string, message> messages;
};

std::string frame_key(const channel_config& channel) {
    return fmt::format("{}/{}/{}/{}", channel.bus, channel.frame.id, channel.frame.extended, channel.frame.mask);
}

std::string bits_key(const drv_signal_t& signal) {
    return fmt::format(":{}/{}/{}", signal.start_bit, signal.length, signal.big_endian);
}

/// One message has one counter; a channel that names none takes that of its neighbours in the message.
void share_sequence(const config_place& place, const toml::table& table, std::vector<channel_config>& channels,
                    channel_config& channel, known_channels& known) {
    if (!known.names.insert(channel.name).second)
        refuse_key(place, table.get("name"), "name", "another [[channel]] has this name");
    known_channels::message& message = known.messages[frame_key(channel)];
    if (message.counted) {
        const channel_config& other = channels[*message.counted];
        if (channel.sequence && !same_bits(*channel.sequence, *other.sequence))
            refuse_key(place, table.get("sequence"), "sequence",
                       fmt::format("channel \"{}\" of the same message names another counter", other.name));
        if (!channel.sequence) channel.sequence = other.sequence;
    } else if (channel.sequence) {
        message.counted = channels.size();
        for (const std::size_t index : message.channels) channels[index].sequence = channel.sequence;
    }
    message.channels.push_back(channels.size());
}

std::string dbc_text_of(const std::string& config, const bus_config& bus) {
    try {
        return read_dbc_text(bus.dbc);
    } catch (const failure& fault) {
        throw failure(fault.code,
                      fmt::format("{}: [[bus]] \"{}\", key \"dbc\": {} (a relative name counts from the folder of "
                                  "the config)",
                                  config, bus.name, fault.what()));
    }
}

/// Every DBC once, by its path. Those that `texts` does not hold yet are read, when there are files to read.
std::map<std::string, dbc_file> read_dbcs(live_config& config, bool from_files, config_texts& texts) {
    std::map<std::string, dbc_file> out;
    for (const bus_config& bus : config.buses) {
        if (bus.dbc.empty() || out.count(bus.dbc)) continue;
        const auto [text, fresh] = texts.dbcs.try_emplace(bus.dbc_name);
        if (fresh && !from_files) refuse_file(config.path, fmt::format("\"{}\" is not in it", bus.dbc_name));
        if (fresh) text->second = dbc_text_of(config.path, bus);
        const dbc_file& dbc = out.emplace(bus.dbc, read_dbc(bus.dbc, text->second)).first->second;
        constexpr std::size_t most_listed = 4;
        for (std::size_t i = 0; i < std::min(dbc.faults.size(), most_listed); ++i)
            config.warnings.push_back(dbc.faults[i]);
        if (dbc.faults.size() > most_listed)
            config.warnings.push_back(
                fmt::format("{}: {} more lines could not be read", dbc.path, dbc.faults.size() - most_listed));
    }
    return out;
}

void read_channels(const std::string& path, const toml::table& file, const std::map<std::string, dbc_file>& dbcs,
                   live_config& config) {
    const toml::array* entries = file["channel"].as_array();
    if (!entries || entries->empty()) refuse_file(path, "no [[channel]], expected at least one");
    known_channels known;
    for (std::size_t i = 0; i < entries->size(); ++i) {
        const toml::table& table = *entries->get_as<toml::table>(i);
        const config_place place{path, entry_name("channel", table, i)};
        require_key(place, table, "name", "every channel has a name");
        require_key(place, table, "role", "force, acceleration, velocity, displacement or aux");
        channel_config channel;
        channel.name = *table["name"].value<std::string>();
        channel.role = role_of(*table["role"].value<std::string>());
        channel.dof = static_cast<int>(table["dof"].value_or(std::int64_t{0}));
        channel.unit = table["unit"].value_or(std::string());
        channel.bus = bus_of(place, table, config);
        const bus_config& bus = config.buses[channel.bus];
        const auto dbc = dbcs.find(bus.dbc);
        resolve_channel(place, table, bus, dbc == dbcs.end() ? nullptr : &dbc->second, channel);
        share_sequence(place, table, config.channels, channel, known);
        config.channels.push_back(std::move(channel));
    }
    const auto rank = [](const channel_config& c) {
        return c.role == channel_role::force ? 0 : c.role == channel_role::aux ? 2 : 1;
    };
    std::vector<channel_config> ordered; // forces, responses, the rest; each in the order of the file
    for (int wanted = 0; wanted <= 2; ++wanted)
        for (const channel_config& channel : config.channels)
            if (rank(channel) == wanted) ordered.push_back(channel);
    config.channels = std::move(ordered);
    for (const channel_config& channel : config.channels) {
        config.n_u += rank(channel) == 0;
        config.n_y += rank(channel) == 1;
    }
    if (config.n_u + config.n_y > 256)
        refuse_file(path, fmt::format("{} force and response channels, at most 256 can be identified together",
                                      config.n_u + config.n_y));
}

/// A unit of something else than what the role says: M, K and R of it would be nonsense, modes are not.
void check_measures(live_config& config, const channel_config& channel, const std::string& si) {
    static const std::array<const char*, 4> measured{"N", "m/s^2", "m/s", "m"}; // as channel_role
    const auto found = static_cast<std::size_t>(std::find(measured.begin(), measured.end(), si) - measured.begin());
    const auto role = static_cast<std::size_t>(channel.role);
    if (role >= measured.size() || found == measured.size() || found == role) return;
    const std::string text = fmt::format(
        "[[channel]] \"{}\": \"{}\" is a unit of {}, but its role is {}; expected one like \"{}\", or another role",
        channel.name, channel.unit, role_names[found], role_names[role], measured[role]);
    if (config.identification.mkr && channel.dof != 0) refuse_file(config.path, text);
    config.unit_remarks.emplace_back("unit_doubtful", text);
}

/// The DBC and the config name two units: one of them is wrong, or a scale is meant.
void compare_units(live_config& config, const channel_config& channel) {
    const unit_rule *own = find_unit(channel.unit), *dbc = find_unit(channel.dbc_unit);
    if (!own || !dbc || channel.dbc_unit.empty() || channel.unit.empty()) return;
    if (std::string(own->si) == dbc->si && own->factor == dbc->factor) return;
    config.unit_remarks.emplace_back(
        "unit_doubtful",
        fmt::format("[[channel]] \"{}\": its unit is \"{}\", but signal {} of the dbc is in \"{}\"; the one of the "
                    "channel is taken. Leave the key out to take that of the dbc",
                    channel.name, channel.unit, channel.signal, channel.dbc_unit));
}

/// Two channels that read the same number are one sensor taken twice.
void check_same_bits(live_config& config) {
    std::unordered_map<std::string, std::size_t> first;
    for (std::size_t i = 0; i < config.channels.size(); ++i) {
        const channel_config& channel = config.channels[i];
        std::string key = frame_key(channel) + bits_key(channel.layout);
        if (channel.field) key += fmt::format("#{}", *channel.field);
        for (const multiplexor& selector : channel.selectors) {
            key += bits_key(selector.layout);
            for (const auto& [low, high] : selector.values) key += fmt::format(",{}-{}", low, high);
        }
        const auto [other, fresh] = first.emplace(std::move(key), i);
        if (!fresh)
            config.warnings.push_back(
                fmt::format("[[channel]] \"{}\" reads the same bits as \"{}\": is its signal or start_bit right?",
                            channel.name, config.channels[other->second].name));
    }
}

void check_units(live_config& config) {
    for (const channel_config& channel : config.channels) compare_units(config, channel);
    for (const channel_config& channel : config.channels)
        if (const unit_rule* rule = find_unit(channel.unit))
            check_measures(config, channel, rule->si);
        else
            config.unit_remarks.emplace_back(
                "unit_unknown",
                fmt::format("channel \"{}\": the unit \"{}\" is not known, its numbers are taken as they are",
                            channel.name, channel.unit));
    for (const auto& [code, text] : config.unit_remarks) config.warnings.push_back(text);
}

} // namespace

// cppcheck-suppress CastIntegerToAddressAtReturn ; the array holds texts
const char* channel_role_name(channel_role role) { return role_names[static_cast<std::size_t>(role)]; }

static live_config make_config(const std::string& path, config_texts texts, bool from_files) {
    toml::table file = parse(path, texts.config);
    if (file.contains("masses") || file.contains("springs") || file.contains("sense_dofs"))
        refuse_file(
            path, "it looks like a RIG.toml, expected a CONFIG.toml: okid simulate RIG.toml makes one (--config FILE)");
    apply_presets(path, file, texts.presets);
    check_schema(path, file);
    live_config config;
    config.path = path;
    read_acquisition(path, file, config);
    read_buses(path, file, config);
    read_channels(path, file, read_dbcs(config, from_files, texts), config);
    read_clocks(file, config);
    read_identification(file, config);
    read_trigger(file, config);
    read_hammer(file, config);
    read_alarm(file, config);
    read_publish(file, config);
    read_virtual(file, config);
    read_record(file, config);
    read_realtime(file, config);
    check_geometry(file, config);
    check_units(config);
    check_same_bits(config);
    config.texts = std::move(texts);
    config.texts.config = without_passwords(config.texts.config);
    return config;
}

live_config load_config(const std::string& path) {
    config_texts texts;
    texts.config = read_input(path, "a CONFIG.toml");
    return make_config(path, std::move(texts), true);
}

live_config load_config_text(const std::string& path, const std::string& text) {
    config_texts texts;
    texts.config = text;
    return make_config(path, std::move(texts), true);
}

live_config load_config(const std::string& path, const config_texts& texts) { return make_config(path, texts, false); }

void require_identifiable(const live_config& config) {
    if (config.n_y == 0)
        refuse_file(
            config.path,
            "no [[channel]] has the role acceleration, velocity or displacement, expected at least one response");
}

mass_plan live_mass_plan(const live_config& config) {
    mass_plan plan;
    plan.hold = config.identification.hold;
    if (!config.identification.mkr) return plan;
    for (std::size_t i = 0; i < config.n_u + config.n_y; ++i) {
        const channel_config& channel = config.channels[i];
        mass_channel& one = (i < config.n_u ? plan.inputs : plan.outputs).emplace_back();
        one.name = channel.name;
        one.dof = channel.dof;
        one.sensing = channel.role == channel_role::displacement ? OKID_SENSE_DISPLACEMENT
                      : channel.role == channel_role::velocity   ? OKID_SENSE_VELOCITY
                                                                 : OKID_SENSE_ACCELERATION;
    }
    return plan;
}

std::vector<drv_filter_t> wanted_frames(const live_config& config, std::size_t bus) {
    std::vector<drv_filter_t> out;
    for (const channel_config& channel : config.channels) {
        if (channel.bus != bus) continue;
        const bool known =
            std::any_of(out.begin(), out.end(), [&](const drv_filter_t& f) { return same_frames(f, channel.frame); });
        if (!known) out.push_back(channel.frame);
    }
    return out;
}

} // namespace okid_host
