// SPDX-License-Identifier: MIT
#include "config_alarm.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {
namespace {

/// The program to run, beside the config unless its path is absolute. A log can be replayed where it is not there.
void read_command(const toml::node& node, live_config& config) {
    const std::filesystem::path given(*node.value<std::string>());
    std::string& path = config.alarm.command;
    path = given.is_absolute() ? given.string() : (std::filesystem::path(config.path).parent_path() / given).string();
    if (!may_execute(path))
        config.warnings.push_back(
            fmt::format("[alarm] command: {} is no program that may be executed; expected a path without arguments (it "
                        "gets the alarm as JSON on standard input)",
                        printable(path)));
}

} // namespace

bool may_execute(const std::string& path) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

void read_alarm(const toml::table& file, live_config& config) {
    alarm_config& out = config.alarm;
    const config_place place{config.path, "[alarm]"};
    const bool sigma = config.identification.sigma_blocks > 0;
    if (const toml::table* table = file["alarm"].as_table()) {
        out.enabled = (*table)["enabled"].value_or(true);
        out.k_sigma = (*table)["k_sigma"].value_or(out.k_sigma);
        out.baseline_updates =
            static_cast<int>((*table)["baseline_updates"].value_or(std::int64_t{out.baseline_updates}));
        out.test_s = (*table)["test_s"].value_or(0.0);
        out.test_rows = static_cast<int>((*table)["test_rows"].value_or(std::int64_t{0}));
        out.false_alarm = (*table)["false_alarm"].value_or(out.false_alarm);
        if (out.test_s > 0 && file.contains("hammer"))
            refuse_key(place, table->get("test_s"), "test_s", "hits of a [hammer] test are no stream to be tested");
        if (table->contains("command")) read_command(*table->get("command"), config);
        if (out.enabled && !sigma && table->contains("enabled"))
            refuse_key(
                place, table->get("enabled"), "enabled",
                "an alarm compares with standard deviations, and [identification] sigma_blocks = 0 computes none");
    }
    out.enabled = out.enabled && sigma;
    if (config.lamps.alarm && !out.enabled)
        config.warnings.emplace_back(
            sigma ? "[lamps] alarm stays inactive: [alarm] enabled = false"
                  : "[lamps] alarm stays inactive: [identification] sigma_blocks = 0 computes no standard deviations");
}

} // namespace okid_host
