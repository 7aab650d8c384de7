// SPDX-License-Identifier: MIT
#include "proposal.hpp"

#include "csv_header.hpp"
#include "files/nearest_name.hpp"
#include "files/units.hpp"

#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr std::size_t most_proposed = 64; ///< columns in a message

/// A list of names as it is typed, "" without names.
std::string typed_names(const std::string& side, const std::vector<std::string>& names) {
    if (names.empty()) return "";
    std::string list;
    for (const std::string& name : names)
        list += (list.empty() ? "" : ",") + (name.find(',') == std::string::npos ? name : '"' + name + '"');
    const bool plain = list.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.,-") ==
                       std::string::npos;
    for (std::size_t at = 0; (at = list.find('\'', at)) != std::string::npos; at += 4) list.replace(at, 1, "'\\''");
    return fmt::format(" --{} {}", side, plain ? list : "'" + list + "'");
}

} // namespace

const char* proposed_side(const std::string& column) {
    if (const std::string role = role_of_unit(unit_of_name(column)); !role.empty())
        return role == "force" ? "inputs" : "outputs";
    const std::string small = lower_case(column);
    for (const char* word : {"force", "hammer", "shaker", "load"})
        if (small.find(word) != std::string::npos) return "inputs";
    const std::string begin = small.substr(0, small.find_last_not_of("0123456789 _xyz+-.") + 1);
    if (begin == "f") return "inputs";
    for (const char* word :
         {"a", "acc", "accel", "acceleration", "v", "vel", "velocity", "disp", "displacement", "out"})
        if (begin == word) return "outputs";
    return "";
}

std::string proposed_options(const std::vector<std::string>& columns) {
    std::vector<std::string> forces, responses;
    for (const std::string& name : columns)
        if (const std::string side = proposed_side(name); !side.empty())
            (side == "inputs" ? forces : responses).push_back(name);
    if (responses.empty() || forces.size() + responses.size() > most_proposed) return "";
    return typed_names("inputs", forces) + typed_names("outputs", responses);
}

} // namespace okid_host
