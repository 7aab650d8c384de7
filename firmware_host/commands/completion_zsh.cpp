// SPDX-License-Identifier: MIT
// The completion script for zsh: one call of _arguments for each command. Works as an autoloaded _okid and when sourced.
#include "completion.hpp"

#include <okid/types.h>

namespace okid_host {
namespace {

constexpr const char* zsh_finders = R"script(
_okid_interfaces() { # of CAN: type 280
    local folder
    local -a found
    for folder in /sys/class/net/*(N); do
        [[ "$(cat $folder/type 2>/dev/null)" == 280 ]] && found+=(${folder:t})
    done
    compadd -a found
}

_okid_devices() {
    local -a found=(/dev/serial/by-id/*(N) /dev/ttyACM*(N) /dev/ttyUSB*(N))
    if [[ $PREFIX == /* ]]; then _files; else compadd -a found; fi
}
)script";

constexpr const char* ending = R"script(
if [[ "${funcstack[1]}" == _okid ]]; then _okid "$@"; else compdef _okid okid; fi
)script";

/// Text within single quotes in which `marks` have no meaning of their own.
std::string escaped(const std::string& text, const std::string& marks) {
    std::string out;
    for (const char c : text) {
        if (c == '\'')
            out += "'\\''";
        else
            out += (marks.find(c) == std::string::npos ? "" : "\\") + std::string(1, c);
    }
    return out;
}

/// What _arguments does for a value; nothing known: only its name is shown.
std::string action(const completion_values& values) {
    std::vector<std::string> calls;
    const bool others =
        values.any_file || values.folder || values.interface || values.device || !values.endings.empty();
    if (!values.words.empty() && !others) return "(" + join(values.words, " ") + ")";
    if (!values.words.empty()) calls.push_back("compadd -- " + join(values.words, " "));
    if (values.any_file) calls.push_back("_files");
    if (values.endings.size() == 1) calls.push_back("_files -g \"*." + values.endings.front() + "\"");
    if (values.endings.size() > 1) // parentheses around one alone would be a qualifier
        calls.push_back("_files -g \"*.(" + join(values.endings, "|") + ")\"");
    if (values.folder) calls.push_back("_files -/");
    if (values.interface) calls.push_back("_okid_interfaces");
    if (values.device) calls.push_back("_okid_devices");
    if (calls.size() == 1 && calls.front().rfind("compadd", 0) != 0) return calls.front();
    return calls.empty() ? "" : "{" + join(calls, "; ") + "}";
}

std::string option_lines(const completion_option& option) {
    const std::string all = join(option.names, " ");
    const bool alone = option.names.front() == "--help" || option.names.front() == "--version";
    std::string out;
    for (const std::string& name : option.names)
        out += std::string("            '(") + (alone ? "- : *" : all) + ")" + name +
               (option.takes_value && name.rfind("--", 0) == 0 ? "=" : "") + "[" + escaped(option.meaning, "[]\\") +
               "]" +
               (option.takes_value ? ":" + escaped(option.label, ":\\") + ":" + action(option.values) : std::string()) +
               "' \\\n";
    return out;
}

std::string command_lines(const completion_command& command) {
    std::string out = "        " + command.name + ") _arguments \\\n";
    for (const completion_option& option : command.options) out += option_lines(option);
    for (std::size_t i = 0; i < command.places.size(); ++i)
        out += "            '" + (command.places[i].repeated ? "*" : std::to_string(i + 1)) + ":" +
               escaped(command.places[i].label, ":\\") + ":" + action(command.places[i].values) + "' \\\n";
    return out + "            ;;\n";
}

} // namespace

std::string zsh_completion(const completion_command& program) {
    std::string out = "#compdef okid\n# zsh completion for okid " OKID_VERSION ", made by `okid completion zsh`\n";
    out += std::string(zsh_finders) + "\n_okid() {\n    local context state state_descr line\n    local -A opt_args\n"
                                      "    local -a commands=(\n";
    for (const completion_command& command : program.commands)
        out += "        '" + command.name + ":" + escaped(command.meaning, ":\\") + "'\n";
    out += "    )\n    _arguments -C \\\n";
    for (const completion_option& option : program.options) out += option_lines(option);
    out += "            '1:command:->command' '*::argument:->arguments'\n"
           "    case $state in\n    command) _describe -t commands 'command of okid' commands ;;\n"
           "    arguments)\n        case $line[1] in\n";
    for (const completion_command& command : program.commands) out += command_lines(command);
    return out + "        esac ;;\n    esac\n}\n" + ending;
}

} // namespace okid_host
