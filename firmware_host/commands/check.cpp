// SPDX-License-Identifier: MIT
// okid check: is a CONFIG.toml right? Opens no device.
#include "align/trigger.hpp"
#include "commands.hpp"
#include "config/config.hpp"
#include "config/config_json.hpp"
#include "config/presets.hpp"
#include "error.hpp"
#include "files/whole_file.hpp"
#include "live/stream_memory.hpp"
#include "live/virtual_channels.hpp"
#include "result/method.hpp"
#include "result/result.hpp"

#include <cmath>
#include <fmt/format.h>
#include <memory>

namespace okid_host {
namespace {

std::string memory_text(const live_config& config) {
    const identification_config& id = config.identification;
    if (id.window_s && id.window == "auto")
        return fmt::format("a window of at most {:g} s, each update chooses how much", *id.window_s);
    if (id.window_s) return fmt::format("a window of {:g} s", *id.window_s);
    if (id.forgetting) return fmt::format("forgetting {:g} a sample", *id.forgetting);
    return "everything since the start";
}

/// When it begins, and the lamps.
std::string start_text(const live_config& config) {
    std::string out;
    if (config.trigger.source != trigger_source::immediate)
        out += fmt::format("begins with {}, and {:g} s before it\n", trigger(config).awaited(),
                           config.trigger.pretrigger_s);
    const auto tell = [&](const char* name, const std::optional<gpio_place>& lamp) {
        if (lamp) out += fmt::format("lamp {}: {}{}\n", name, lamp->text(), lamp->active_low ? ", active low" : "");
    };
    tell("armed", config.lamps.armed);
    tell("go", config.lamps.go);
    tell("alarm", config.lamps.alarm);
    return out;
}

/// Reads what [virtual] names, too.
std::string virtual_text(const live_config& config) {
    std::string out;
    if (config.virtual_sensors.model.empty()) return out;
    for (const auto& one : virtual_channels(config).described())
        out += fmt::format("{}{}", out.empty() ? "computed: " : ", ", one["name"].get<std::string>());
    return out + "\n";
}

std::string summary(const live_config& config, const stream_config& stream, const std::string& computed) {
    const identification_config& id = stream.wanted;
    std::string out = fmt::format("{}: OK\n\n{:<16} {:<13} {:<9} {:<10} {:<12} {:<20} {}\n", config.path, "channel",
                                  "role", "unit", "bus", "identifier", "bits", "samples counted by");
    for (const channel_config& channel : config.channels) {
        const drv_signal_t& layout = channel.layout;
        const char* kind = layout.value == DRV_VALUE_INTEGER ? (layout.is_signed ? "int" : "uint") : "float";
        out += fmt::format(
            "{:<16} {:<13} {:<9} {:<10} {:<12} {:<20} {}\n", channel.name, channel_role_name(channel.role),
            channel.unit.empty() ? "-" : channel.unit, config.buses[channel.bus].name,
            fmt::format("{:#x}{}", channel.frame.id, channel.frame.extended ? " ext" : ""),
            fmt::format("{}{} at {} {}", kind, layout.length, layout.start_bit, layout.big_endian ? "big" : "little"),
            channel.sequence ? fmt::format("{}-bit counter", channel.sequence->length) : "time stamps");
    }
    out +=
        fmt::format("\n{:g} Hz, {} force and {} response channel{}{}\n", config.rate_hz, config.n_u, config.n_y,
                    config.n_y == 1 ? "" : "s",
                    stream.sample == OKID_SAMPLE_INT16 && id.method != "auto" ? ", 16-bit codes summed exactly" : "");
    const okid_method_t method = method_of(id.method);
    const std::string horizon =
        id.method == "auto" ? "several methods, horizons and rates, modes sought again when an eighth of the samples "
                              "is new, an update each"
                            : fmt::format("{}{} block rows, an update each",
                                          looks_back_rows(method, config.n_u) ? "" : fmt::format("p {}, ", id.p),
                                          rows_used(method, config.n_u, id.p, id.rows));
    out += fmt::format("{}, {} {:g} s, memory: {}\n", id.method, horizon, id.update_s, memory_text(config));
    out += fmt::format("needs {:.0f} MB of memory, at most {:g} are allowed\n", std::ceil(stream_bytes(stream) / 1e6),
                       id.max_memory_mb);
    out += start_text(config) + computed;
    for (const auto& [code, text] : stream.said) out += fmt::format("warning: {}\n", text);
    for (const std::string& text : config.warnings) out += fmt::format("warning: {}\n", text);
    return out;
}

} // namespace

void add_check(CLI::App& app) {
    struct arguments {
        std::string config;
        bool json = false, presets = false;
    };
    auto given = std::make_shared<arguments>();
    CLI::App* command = app.add_subcommand("check", "Check a CONFIG.toml and show what it means; opens no device");
    command->add_option("config", given->config, "the file to check")->type_name("CONFIG.toml");
    command->add_flag("--json", given->json, "the channels as they will be decoded, as JSON");
    command->add_flag("--presets", given->presets, "list what preset = \"…\" can name, and nothing else");
    command->footer("Example:\n  okid check frame.toml");
    command->callback([given] {
        if (given->presets) {
            write_whole_file("-", list_presets());
            return;
        }
        if (given->config.empty())
            throw failure(exit_usage,
                          "the file to check is missing: okid check CONFIG.toml; okid check --presets lists "
                          "the presets there are");
        const live_config config = load_config(given->config);
        require_identifiable(config);
        const stream_config stream = stream_of(config);
        require_memory(stream); // computed, none of it is taken
        const std::string computed = virtual_text(config);
        write_whole_file(
            "-", given->json
                     ? config_json(config).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"
                     : shown(summary(config, stream, computed)));
    });
}

} // namespace okid_host
