// SPDX-License-Identifier: MIT
#include "config_geometry.hpp"

#include "error.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <set>

namespace okid_host {
namespace {

constexpr std::array<std::string_view, 9> directions{"x", "y", "z", "+x", "+y", "+z", "-x", "-y", "-z"};

bool is_number(const toml::node* node) {
    const std::optional<double> value = node ? node->value<double>() : std::nullopt;
    return node && node->is_number() && value && std::isfinite(*value);
}

bool is_node(const toml::node* node, std::size_t count) {
    const std::optional<std::int64_t> value = node ? node->value_exact<std::int64_t>() : std::nullopt;
    return value && *value >= 1 && static_cast<std::uint64_t>(*value) <= count;
}

bool is_direction(const toml::node* node) {
    const std::optional<std::string_view> value = node ? node->value_exact<std::string_view>() : std::nullopt;
    return value && std::find(directions.begin(), directions.end(), *value) != directions.end();
}

/// Nodes around a surface: three or more, none twice.
bool is_surface(const toml::array& surface, std::size_t count) {
    std::set<std::int64_t> seen;
    for (const toml::node& node : surface)
        if (!is_node(&node, count) || !seen.insert(*node.value_exact<std::int64_t>()).second) return false;
    return surface.size() >= 3;
}

/// Every entry of a list must be one that `good` takes. @return how many there are
template <class Test>
std::size_t check_entries(const config_place& place, const toml::table& table, const char* key, const char* expected,
                          Test good) {
    const toml::array* list = table[key].as_array();
    if (!list) return 0;
    for (std::size_t k = 0; k < list->size(); ++k) {
        const toml::node& entry = *list->get(k);
        if (!good(entry)) refuse_key(place, &entry, key, fmt::format("entry {}: expected {}", k + 1, expected));
    }
    return list->size();
}

/// The same for entries that are arrays.
template <class Test>
std::size_t check_list(const config_place& place, const toml::table& table, const char* key, const char* expected,
                       Test good) {
    return check_entries(place, table, key, expected, [&](const toml::node& entry) {
        const toml::array* one = entry.as_array();
        return one && good(*one);
    });
}

} // namespace

void check_geometry(const toml::table& file, const live_config& config) {
    const toml::table* table = file["geometry"].as_table();
    if (!table) return;
    const config_place place{config.path, "[geometry]"};
    for (const char* key : {"nodes", "dofs"})
        if (const toml::array* list = (*table)[key].as_array(); !list || list->empty())
            refuse_key(place, table, key, "it is missing or empty, expected at least one entry");
    const std::size_t nodes =
        check_list(place, *table, "nodes", "three numbers: [x, y, z]", [](const toml::array& node) {
            return node.size() == 3 && is_number(node.get(0)) && is_number(node.get(1)) && is_number(node.get(2));
        });
    const std::string dof = fmt::format("a node from 1 to {} and one of x y z -x -y -z: [1, \"z\"]", nodes);
    const std::size_t dofs = check_list(place, *table, "dofs", dof.c_str(), [&](const toml::array& one) {
        return one.size() == 2 && is_node(one.get(0), nodes) && is_direction(one.get(1));
    });
    const std::string line = fmt::format("two nodes from 1 to {}: [1, 2]", nodes);
    check_list(place, *table, "lines", line.c_str(), [&](const toml::array& one) {
        return one.size() == 2 && is_node(one.get(0), nodes) && is_node(one.get(1), nodes);
    });
    const std::string surface = fmt::format("three different nodes or more from 1 to {}: [1, 2, 3]", nodes);
    check_list(place, *table, "surfaces", surface.c_str(),
               [&](const toml::array& one) { return is_surface(one, nodes); });
    const std::string fixed = fmt::format("a node from 1 to {}", nodes);
    check_entries(place, *table, "fixed", fixed.c_str(), [&](const toml::node& one) { return is_node(&one, nodes); });
    for (const channel_config& channel : config.channels)
        if (static_cast<std::size_t>(std::abs(channel.dof)) > dofs)
            refuse_key(place, table, "dofs",
                       fmt::format("found {} entries, but channel \"{}\" measures degree of freedom {}", dofs,
                                   channel.name, channel.dof));
}

} // namespace okid_host
