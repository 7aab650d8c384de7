// SPDX-License-Identifier: MIT
// The completion script for bash: stands on bash alone, not on the functions of the package bash-completion.
#include "completion.hpp"

#include <okid/types.h>

namespace okid_host {
namespace {

/// What adds candidates to COMPREPLY that begin with $cur.
constexpr const char* adders = R"script(
_okid_words() {
    local word
    for word in "$@"; do [[ $word == "$cur"* ]] && COMPREPLY+=("$word"); done
}

_okid_folders() {
    local path
    compopt -o filenames 2>/dev/null
    while IFS= read -r path; do COMPREPLY+=("$path"); done < <(compgen -d -- "$cur")
}

_okid_files() { # endings; none: every file. Folders lead to files.
    local path ending
    _okid_folders
    while IFS= read -r path; do
        [[ -d ${path/#\~\//$HOME/} ]] && continue
        if (($# == 0)); then COMPREPLY+=("$path"); fi
        for ending in "$@"; do
            if [[ $path == *."$ending" ]]; then COMPREPLY+=("$path"); fi
        done
    done < <(compgen -f -- "$cur")
}

_okid_interfaces() { # of CAN: type 280
    local path
    for path in /sys/class/net/*; do
        [[ $(cat "$path/type" 2>/dev/null) == 280 ]] && _okid_words "${path##*/}"
    done
}

_okid_devices() {
    local path
    if [[ $cur == /* ]]; then _okid_files; return; fi
    for path in /dev/serial/by-id/* /dev/ttyACM* /dev/ttyUSB*; do [[ -e $path ]] && _okid_words "$path"; done
}
)script";

/// Where on the line the cursor is: $command, $place (arguments without dashes before it), $prev and $cur.
constexpr const char* reader = R"script(
_okid() {
    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} command="" place=0 at word
    COMPREPLY=()
    if [[ $cur == "=" ]]; then # --name=value comes as three words
        cur=""
    elif [[ $prev == "=" ]]; then
        prev=${COMP_WORDS[COMP_CWORD-2]}
    fi
    cur=${cur#[\"\']}
    cur=${cur//\\/}
    for ((at = 1; at < COMP_CWORD; ++at)); do
        word=${COMP_WORDS[at]}
        if [[ $word == -* ]]; then
            if [[ ${COMP_WORDS[at+1]-} == "=" ]]; then
                ((at += 2))
            elif _okid_takes_value "$command" "$word"; then
                ((at += 1))
            fi
        elif [[ -z $command ]]; then
            command=$word
        else
            ((place += 1))
        fi
    done
    if _okid_takes_value "$command" "$prev"; then
        _okid_value "$command" "$prev"
    elif [[ $cur == -* ]]; then
        _okid_option "$command"
    else
        _okid_place "$command" "$place"
    fi
    return 0
}

complete -F _okid okid
)script";

std::string call_adders(const completion_values& values) {
    std::vector<std::string> calls;
    if (!values.words.empty()) calls.push_back("_okid_words " + join(values.words, " "));
    if (values.any_file) calls.push_back("_okid_files");
    if (!values.endings.empty()) calls.push_back("_okid_files " + join(values.endings, " "));
    if (values.folder) calls.push_back("_okid_folders");
    if (values.interface) calls.push_back("_okid_interfaces");
    if (values.device) calls.push_back("_okid_devices");
    return join(calls, "; ");
}

/// A function of bash: one line of a case for each command that has something to say.
std::string by_case(const std::string& name, const std::string& subject, const std::string& lines) {
    return "\n" + name + "() {\n    case " + subject + " in\n" + lines + "    esac\n}\n";
}

std::string takes_value(const completion_command& program) {
    std::vector<std::string> names;
    for (const completion_command& command : program.commands)
        for (const completion_option& option : command.options)
            for (const std::string& name : option.names)
                if (option.takes_value) names.push_back(command.name + ":" + name);
    return by_case("_okid_takes_value", "$1:$2", "    " + join(names, "|") + ") return 0 ;;\n    *) return 1 ;;\n");
}

std::string values_of_options(const completion_command& program) {
    std::string lines;
    for (const completion_command& command : program.commands)
        for (const completion_option& option : command.options)
            if (const std::string calls = call_adders(option.values); !calls.empty()) {
                std::vector<std::string> names;
                for (const std::string& name : option.names) names.push_back(command.name + ":" + name);
                lines += "    " + join(names, "|") + ") " + calls + " ;;\n";
            }
    return by_case("_okid_value", "$1:$2", lines);
}

std::string options_of(const completion_command& command) {
    std::vector<std::string> names;
    for (const completion_option& option : command.options)
        if (!option.names.empty()) names.push_back(option.names.front());
    return join(names, " ");
}

std::string options(const completion_command& program) {
    std::string lines = "    \"\") _okid_words " + options_of(program) + " ;;\n";
    for (const completion_command& command : program.commands)
        lines += "    " + command.name + ") _okid_words " + options_of(command) + " ;;\n";
    return by_case("_okid_option", "$1", lines);
}

/// Where no argument is expected any more the options are offered.
std::string places(const completion_command& program) {
    std::vector<std::string> names;
    for (const completion_command& command : program.commands) names.push_back(command.name);
    std::string lines = "    :*) _okid_words " + join(names, " ") + " ;;\n";
    for (const completion_command& command : program.commands)
        for (std::size_t i = 0; i < command.places.size(); ++i)
            lines += "    " + command.name + ":" + (command.places[i].repeated ? "*" : std::to_string(i)) + ") " +
                     call_adders(command.places[i].values) + " ;;\n";
    return by_case("_okid_place", "$1:$2", lines + "    *) _okid_option \"$1\" ;;\n");
}

} // namespace

std::string bash_completion(const completion_command& program) {
    return "# bash completion for okid " OKID_VERSION ", made by `okid completion bash`\n" + std::string(adders) +
           takes_value(program) + values_of_options(program) + options(program) + places(program) + reader;
}

} // namespace okid_host
