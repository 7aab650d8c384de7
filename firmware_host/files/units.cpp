// SPDX-License-Identifier: MIT
#include "units.hpp"

#include <array>
#include <utility>

namespace okid_host {
namespace {

constexpr unit_rule rules[] = {
    {"N", 1, "N"},
    {"kN", 1e3, "N"},
    {"mN", 1e-3, "N"},
    {"lbf", 4.4482216152605, "N"},
    {"Nm", 1, "Nm"},
    {"N m", 1, "Nm"},
    {"m/s^2", 1, "m/s^2"},
    {"m/s2", 1, "m/s^2"},
    {"mps2", 1, "m/s^2"},
    {"m/s\u00b2", 1, "m/s^2"},
    {"mm/s^2", 1e-3, "m/s^2"},
    {"cm/s^2", 1e-2, "m/s^2"},
    {"g", 9.80665, "m/s^2"},
    {"mg", 9.80665e-3, "m/s^2"},
    {"m/s", 1, "m/s"},
    {"mm/s", 1e-3, "m/s"},
    {"m", 1, "m"},
    {"mm", 1e-3, "m"},
    {"um", 1e-6, "m"},
    {"\u00b5m", 1e-6, "m"},
    {"", 1, ""},
};

} // namespace

const unit_rule* find_unit(const std::string& name) {
    for (const unit_rule& rule : rules)
        if (name == rule.name) return &rule;
    return nullptr;
}

std::string role_of_unit(const std::string& unit) {
    static const std::array<std::pair<const char*, const char*>, 5> roles{
        {{"N", "force"}, {"Nm", "force"}, {"m/s^2", "acceleration"}, {"m/s", "velocity"}, {"m", "displacement"}}};
    const unit_rule* rule = find_unit(unit);
    if (rule == nullptr) return "";
    for (const auto& [si, role] : roles)
        if (rule->si == std::string(si)) return role;
    return "";
}

} // namespace okid_host
