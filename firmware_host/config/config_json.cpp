// SPDX-License-Identifier: MIT
// PURPOSE  the whole checked configuration as one JSON object, so that no other language needs a parser of its own
// METHOD   the keys have the names they have in the file; what the file leaves out stands here with its default, null = none
#include "config_json.hpp"

#include "toml_parser.hpp"

#include <array>
#include <sstream>

namespace okid_host {
namespace {

using nlohmann::ordered_json;

template <class Value> ordered_json or_null(const std::optional<Value>& value) {
    return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json text_or_null(const std::string& text) { return text.empty() ? ordered_json(nullptr) : ordered_json(text); }

ordered_json bits_json(const drv_signal_t& signal) {
    static const std::array<const char*, 3> values{"integer", "float32", "float64"};
    return {{"start_bit", signal.start_bit},
            {"length", signal.length},
            {"byte_order", signal.big_endian ? "big" : "little"},
            {"signed", signal.is_signed != 0},
            {"value", values[signal.value]},
            {"scale", signal.scale},
            {"offset", signal.offset}};
}

ordered_json channel_json(const live_config& config, const channel_config& channel) {
    ordered_json out{{"name", channel.name},       {"role", channel_role_name(channel.role)},
                     {"unit", channel.unit},       {"bus", config.buses[channel.bus].name},
                     {"can_id", channel.frame.id}, {"extended", channel.frame.extended != 0}};
    out.update(bits_json(channel.layout));
    const bool multiplexed = !channel.selectors.empty();
    out["multiplexor"] = multiplexed ? bits_json(channel.selectors.front().layout) : ordered_json(nullptr);
    out["multiplexor_value"] =
        multiplexed ? ordered_json(channel.selectors.front().values.front().first) : ordered_json(nullptr);
    out["sequence"] = channel.sequence ? bits_json(*channel.sequence) : ordered_json(nullptr);
    out["dof"] = channel.dof == 0 ? ordered_json(nullptr) : ordered_json(channel.dof);
    out["field"] = or_null(channel.field);
    out["mask"] = channel.frame.mask;
    out["message"] = text_or_null(channel.message);
    out["signal"] = text_or_null(channel.signal);
    out["si_unit"] = channel.si_unit();
    out["si_factor"] = channel.si_factor();
    return out;
}

ordered_json frame_json(const drv_frame_t& frame) {
    return {{"can_id", frame.id},
            {"extended", (frame.flags & DRV_FRAME_EXTENDED) != 0},
            {"data", std::vector<int>(frame.data, frame.data + frame.len)}};
}

ordered_json bus_json(const bus_config& bus) {
    ordered_json out{{"name", bus.name},
                     {"type", bus.type},
                     {"interface", text_or_null(bus.interface)},
                     {"adapter", text_or_null(bus.adapter)},
                     {"adapter_channel", bus.adapter_channel},
                     {"device", text_or_null(bus.device)},
                     {"file", text_or_null(bus.file)},
                     {"fd", bus.fd},
                     {"bitrate", or_null(bus.bitrate)},
                     {"dbitrate", or_null(bus.dbitrate)},
                     {"dbc", text_or_null(bus.dbc)},
                     {"clock", bus.free_clock ? "free" : "shared"},
                     {"rate_hz", or_null(bus.rate_hz)},
                     {"sync_hz", or_null(bus.sync_hz)},
                     {"sync", bus.sync_hz ? frame_json(bus.sync_frame) : ordered_json(nullptr)},
                     {"start", ordered_json::array()}};
    for (const drv_frame_t& frame : bus.start_frames) out["start"].push_back(frame_json(frame));
    if (bus.on_line()) out.update({{"baud", bus.baud}, {"btr", text_or_null(bus.btr)}});
    if (bus.serial())
        out.update({{"framing", drv_framings[bus.framing].name},
                    {"counter_field", or_null(bus.counter_field)},
                    {"counter_bits", bus.counter_bits}});
    return out;
}

ordered_json identification_json(const identification_config& id) {
    return {{"method", id.method},
            {"p", id.method == "auto" ? ordered_json(nullptr) : ordered_json(id.p)},
            {"rows", id.rows == 0 ? ordered_json(nullptr) : ordered_json(id.rows)},
            {"hankel", id.hankel},
            {"order", id.order == 0 ? ordered_json("auto") : ordered_json(id.order)},
            {"hold", id.hold},
            {"detrend", id.detrend},
            {"window_s", or_null(id.window_s)},
            {"window", id.window},
            {"refine", id.refine},
            {"forgetting", or_null(id.forgetting)},
            {"update_s", id.update_s},
            {"sigma", id.sigma_blocks == 0 ? "none"
                      : id.analytic        ? "analytic"
                                           : "jackknife"},
            {"sigma_blocks", id.sigma_blocks},
            {"restart_on_change", id.restart_on_change},
            {"mkr", id.mkr}};
}

ordered_json start_json(const live_config& config) {
    const trigger_config& trigger = config.trigger;
    if (trigger.source == trigger_source::immediate) return {{"source", "immediate"}};
    ordered_json out{{"source", trigger.source == trigger_source::gpio ? "gpio" : "level"},
                     {"pretrigger_s", trigger.pretrigger_s}};
    if (trigger.source == trigger_source::level)
        out.update({{"channel", config.channels[trigger.channel].name}, {"level", trigger.level}});
    return out;
}

ordered_json hammer_json(const live_config& config) {
    const hammer_config& hammer = config.hammer;
    if (!hammer.enabled) return nullptr;
    return {{"channel", config.channels[hammer.channel].name},
            {"level", hammer.level},
            {"hits", hammer.hits},
            {"points", hammer.points},
            {"length_s", hammer.length_s},
            {"pretrigger_s", hammer.pretrigger_s},
            {"double_percent", hammer.double_percent},
            {"spectrum_hz", hammer.spectrum_hz}};
}

ordered_json record_json(const record_config& record) {
    if (!record.wanted) return nullptr;
    return {{"directory", record.directory},
            {"segment_mb", record.segment_mb},
            {"max_mb", record.max_mb},
            {"pretrigger_s", record.pretrigger_s}};
}

/// Checked and kept as it stands in the file.
ordered_json geometry_json(const toml::table& file) {
    const toml::table* table = file["geometry"].as_table();
    if (!table) return nullptr;
    std::ostringstream text;
    text << toml::json_formatter(*table);
    return ordered_json::parse(text.str());
}

} // namespace

ordered_json config_json(const live_config& config) {
    const toml::table file = parse_toml(config.texts.config, config.path);
    ordered_json out{{"schema", "okid.check/1"},   {"config", config.path}, {"rate_hz", config.rate_hz},
                     {"inputs", config.n_u},       {"outputs", config.n_y}, {"channels", ordered_json::array()},
                     {"warnings", config.warnings}};
    for (const channel_config& channel : config.channels) out["channels"].push_back(channel_json(config, channel));
    out["decimate"] = config.decimate;
    out["notes"] = ordered_json::object();
    for (const auto& [key, text] : config.notes) out["notes"][key] = text;
    out["buses"] = ordered_json::array();
    for (const bus_config& bus : config.buses) out["buses"].push_back(bus_json(bus));
    out["identification"] = identification_json(config.identification);
    out["alarm"] = {{"enabled", config.alarm.enabled},
                    {"k_sigma", config.alarm.k_sigma},
                    {"baseline_updates", config.alarm.baseline_updates},
                    {"test_s", config.alarm.test_s > 0 ? ordered_json(config.alarm.test_s) : ordered_json(nullptr)},
                    {"false_alarm", config.alarm.false_alarm}};
    out["trigger"] = start_json(config);
    out["hammer"] = hammer_json(config);
    out["record"] = record_json(config.record);
    out["publish"] = {{"socket", text_or_null(config.publish.socket)}, {"samples", config.publish.samples}};
    out["geometry"] = geometry_json(file);
    out["sections"] = ordered_json::array();
    for (const auto& [key, node] : file) out["sections"].push_back(key.str());
    return out;
}

} // namespace okid_host
