// SPDX-License-Identifier: MIT
// The completion script for fish: one line for each command, option and argument.
#include "completion.hpp"

#include <okid/types.h>

namespace okid_host {
namespace {

constexpr const char* fish_finders = R"script(
function __okid_command --description 'the command on the line, if any'
    for word in (commandline -opc)[2..]
        string match -q -- '-*' $word; or begin
            echo $word
            return
        end
    end
end

function __okid_at --description 'is this the command on the line? none: is there none yet?'
    set -l found (__okid_command)
    test "$found" = "$argv"
end

function __okid_files --description 'folders, and files of these endings'
    for path in (__fish_complete_path (commandline -ct) | string replace -r '\t.*' '')
        if string match -q -- '*/' $path
            echo $path
        else
            for ending in $argv
                string match -q -- "*.$ending" $path; and echo $path
            end
        end
    end
end

function __okid_interfaces --description 'network interfaces of CAN: type 280'
    for folder in /sys/class/net/*
        test (cat $folder/type 2>/dev/null)x = 280x; and basename $folder
    end
end

function __okid_devices --description 'serial devices'
    for path in /dev/serial/by-id/* /dev/ttyACM* /dev/ttyUSB*
        echo $path
    end
    string match -q '/*' (commandline -ct); and __fish_complete_path (commandline -ct)
end

complete -c okid -e
complete -c okid -f
)script";

std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += (c == '\'' || c == '\\' ? "\\" : "") + std::string(1, c);
    return out + "'";
}

std::string candidates(const completion_values& values) {
    std::vector<std::string> parts = values.words;
    if (!values.endings.empty()) parts.push_back("(__okid_files " + join(values.endings, " ") + ")");
    if (values.any_file) parts.emplace_back("(__fish_complete_path (commandline -ct))");
    if (values.folder) parts.emplace_back("(__fish_complete_directories (commandline -ct))");
    if (values.interface) parts.emplace_back("(__okid_interfaces)");
    if (values.device) parts.emplace_back("(__okid_devices)");
    return parts.empty() ? "" : " -a " + quoted(join(parts, " "));
}

/// @param condition  ` -n '…'`, where the option may stand
std::string option_line(const std::string& condition, const completion_option& option) {
    std::string out = "complete -c okid" + condition;
    for (const std::string& name : option.names)
        out += name.rfind("--", 0) == 0 ? " -l " + name.substr(2) : " -s " + name.substr(1);
    if (option.takes_value) out += " -x" + candidates(option.values);
    return out + " -d " + quoted(option.meaning) + "\n";
}

} // namespace

std::string fish_completion(const completion_command& program) {
    std::string out =
        "# fish completion for okid " OKID_VERSION ", made by `okid completion fish`\n" + std::string(fish_finders);
    const std::string before = " -n __okid_at";
    for (const completion_option& option : program.options) out += option_line(before, option);
    for (const completion_command& command : program.commands)
        out += "complete -c okid" + before + " -a " + command.name + " -d " + quoted(command.meaning) + "\n";
    for (const completion_command& command : program.commands) {
        const std::string inside = " -n '__okid_at " + command.name + "'";
        for (const completion_option& option : command.options) out += option_line(inside, option);
        for (const completion_place& place : command.places)
            out += "complete -c okid" + inside + candidates(place.values) + "\n";
    }
    return out;
}

} // namespace okid_host
