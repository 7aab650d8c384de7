// SPDX-License-Identifier: MIT
#include "pole_table.hpp"

#include "json_number.hpp"

namespace okid_host {

nlohmann::ordered_json pole_table_json(const pole_table& table) {
    using nlohmann::ordered_json;
    ordered_json out{{"runs", ordered_json::array()}, {"poles", ordered_json::object()}};
    for (const pole_table::run& one : table.runs)
        out["runs"].push_back({{"method", one.method}, {"fs_hz", number_json(one.fs_hz)}, {"rows", one.rows}});
    const auto column = [&](const char* name, auto value) {
        ordered_json& to = out["poles"][name] = ordered_json::array();
        for (const pole_table::pole& pole : table.poles) to.push_back(value(pole));
    };
    column("run", [](const auto& pole) { return pole.run; });
    column("order", [](const auto& pole) { return pole.order; });
    column("frequency_hz", [](const auto& pole) { return number_json(pole.frequency_hz); });
    column("damping_ratio", [](const auto& pole) { return number_json(pole.damping_ratio); });
    column("mpc", [](const auto& pole) { return number_json(pole.mpc); });
    column("emac", [](const auto& pole) { return number_json(pole.emac); });
    column("mode", [](const auto& pole) { return pole.mode; });
    return out;
}

} // namespace okid_host
