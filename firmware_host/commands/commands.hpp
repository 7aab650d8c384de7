// SPDX-License-Identifier: MIT
// One function a sub-command: adds itself to the command line and leaves what to do in its callback.
#pragma once
#include <CLI/CLI.hpp>

namespace okid_host {

void add_identify(CLI::App& app);
void add_compare(CLI::App& app);
void add_merge(CLI::App& app);
void add_simulate(CLI::App& app);
void add_run(CLI::App& app);
void add_record(CLI::App& app);
void add_replay(CLI::App& app);
void add_convert(CLI::App& app);
void add_check(CLI::App& app);
void add_init(CLI::App& app);
void add_doctor(CLI::App& app);
void add_bench(CLI::App& app);
void add_support_bundle(CLI::App& app);
void add_completion(CLI::App& app);

/// ", without MQTT, ...": what this build of the program cannot do; "" where nothing is missing.
std::string left_out();

} // namespace okid_host
