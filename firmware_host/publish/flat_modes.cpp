// SPDX-License-Identifier: MIT
#include "flat_modes.hpp"

#include <cmath>
#include <fmt/format.h>

namespace okid_host {

double number_of(const nlohmann::ordered_json& object, const std::string& key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? found->get<double>() : NAN;
}

void live_numbers::take(const publication& one) {
    const nlohmann::ordered_json& event = *one.event;
    if (one.type == "gap") ++gaps;
    if (one.type == "change") ++changes;
    if (one.type == "alarm") alarm = true, ++alarms;
    if (one.type == "alarm_over") alarm = false;
    if (one.type == "stats") {
        bus = event.at("bus");
        channel = event.at("channel");
    }
    if (one.type != "modes") return;
    t = event.at("t").get<double>();
    wall_s = one.wall_s;
    samples = event.at("samples").get<std::int64_t>();
    settled = event.at("settled").get<bool>();
    modes.clear();
    for (const auto& each : event.at("modes"))
        if (const double track = number_of(each, "track"); track > 0) // null: none yet
            modes.push_back({static_cast<int>(track), number_of(each, "frequency_hz"), number_of(each, "damping_ratio"),
                             number_of(each, "frequency_std_hz"), number_of(each, "damping_ratio_std"),
                             each.value("alarm", false)});
}

std::string flat_json(const live_numbers& from) {
    nlohmann::ordered_json out{{"timestamp", from.wall_s},
                               {"t", from.t},
                               {"samples", from.samples},
                               {"settled", from.settled ? 1 : 0},
                               {"alarm", from.alarm ? 1 : 0}};
    for (const live_numbers::mode& each : from.modes) {
        const std::string name = fmt::format("mode{}_", each.track);
        out[name + "frequency_hz"] = each.frequency_hz;
        out[name + "damping_ratio"] = each.damping_ratio;
        if (std::isfinite(each.frequency_std_hz)) out[name + "frequency_std_hz"] = each.frequency_std_hz;
        if (std::isfinite(each.damping_ratio_std)) out[name + "damping_ratio_std"] = each.damping_ratio_std;
    }
    for (const auto& [name, counts] : from.bus.items()) {
        out[name + "_received"] = number_of(counts, "received");
        out[name + "_lost"] = number_of(counts, "lost");
    }
    return out.dump();
}

} // namespace okid_host
