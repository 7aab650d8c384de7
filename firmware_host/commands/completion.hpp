// SPDX-License-Identifier: MIT
// What a shell needs to complete a command line of okid, and the scripts made of it.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace okid_host {

/// What can stand in one place of a command line, read out of the type name that --help shows: alternatives with `|`
/// between them. A word in lower case stands for itself (zoh|foh), NAME.ext for a file of that ending, FILE for any
/// file, FOLDER, INTERFACE (of CAN) and DEVICE for what they say; anything else is the user's own.
struct completion_values {
    std::vector<std::string> words, endings;
    bool any_file = false, folder = false, interface = false, device = false;
};

struct completion_option {
    std::vector<std::string> names; ///< with their dashes, the long ones first
    std::string meaning, label;     ///< one clause; the type name
    bool takes_value = false;
    completion_values values;
};

struct completion_place {
    std::string label;
    bool repeated = false; ///< as often as one likes
    completion_values values;
};

struct completion_command {
    std::string name, meaning;
    std::vector<completion_option> options;
    std::vector<completion_place> places; ///< the arguments without dashes, in order
    std::vector<completion_command> commands;
};

completion_values read_values(const std::string& type_name);
completion_command read_command(const CLI::App& app);

/// Words with `between` between them, each within `quote`.
std::string join(const std::vector<std::string>& words, const std::string& between, const std::string& quote = "");

/// Whole scripts; loading one defines functions and completions of okid and nothing else.
std::string bash_completion(const completion_command& program);
std::string zsh_completion(const completion_command& program);
std::string fish_completion(const completion_command& program);

} // namespace okid_host
