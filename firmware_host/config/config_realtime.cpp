// SPDX-License-Identifier: MIT
#include "config_realtime.hpp"

#include <fmt/format.h>
#include <sched.h>

namespace okid_host {

void read_realtime(const toml::table& file, live_config& config) {
    const toml::table* table = file["realtime"].as_table();
    if (!table) return;
    const config_place place{config.path, "[realtime]"};
    realtime_config& out = config.realtime;
    if (const toml::node* node = table->get("priority")) {
        out.priority = static_cast<int>(*node->value<std::int64_t>());
        out.priority_asked = true;
    }
    out.lock_memory = (*table)["lock_memory"].value_or(false);
    const toml::node* cpus = table->get("cpus");
    if (!cpus) return;
    for (const toml::node& node : *cpus->as_array()) {
        const auto cpu = node.value_exact<std::int64_t>();
        if (!cpu || *cpu < 0 || *cpu >= CPU_SETSIZE)
            refuse_key(
                place, cpus, "cpus",
                fmt::format("found {}, expected numbers of processors, such as [1] or [2, 3]", found_value(node)));
        out.cpus.push_back(static_cast<int>(*cpu));
    }
    if (out.cpus.empty())
        refuse_key(place, cpus, "cpus", "found [], expected at least one processor; leave the key out for all");
}

} // namespace okid_host
