// SPDX-License-Identifier: MIT
// okid doctor: what a run writes to and starts.
#include "config/config_alarm.hpp"
#include "findings.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

namespace okid_host {
namespace {

namespace fs = std::filesystem;

/// The folder itself, or the nearest one above it that is there: it is made when recording begins.
fs::path nearest_folder(const std::string& wanted) {
    std::error_code ignored;
    fs::path folder = fs::absolute(wanted, ignored);
    while (!fs::exists(folder, ignored) && folder.has_relative_path()) folder = folder.parent_path();
    return folder;
}

void check_recording(findings& out, const record_config& wanted) {
    const fs::path there = nearest_folder(wanted.directory);
    std::error_code reason;
    if (!fs::is_directory(there, reason))
        return out.missing("recording", there.string() + " is no folder", "name another [record] directory");
    if (access(there.c_str(), W_OK | X_OK) != 0)
        return out.missing("recording", fmt::format("{}: {}", there.string(), std::strerror(errno)),
                           fmt::format("sudo chown $USER {}, or name another [record] directory", there.string()));
    const fs::space_info room = fs::space(there, reason);
    if (reason) return out.note("recording", fmt::format("{}: {}", there.string(), reason.message()));
    const double free_mb = static_cast<double>(room.available) / 1e6;
    const std::string found = fmt::format("{}: {:.0f} MB free", wanted.directory, free_mb);
    if (free_mb < 2 * wanted.segment_mb)
        out.missing("recording", found + fmt::format(", a journal grows to {:g} MB", wanted.segment_mb),
                    "free space there, or name a [record] directory on another disk");
    else if (free_mb < wanted.max_mb)
        out.note("recording",
                 found + fmt::format(", less than max_mb = {:g}: the disk will be full first", wanted.max_mb),
                 "lower [record] max_mb, so that the oldest journals are deleted in time");
    else
        out.well("recording", found + fmt::format(", the oldest journals are deleted at {:g} MB", wanted.max_mb));
}

void check_socket(findings& out, const std::string& path) {
    const fs::path folder = fs::absolute(path).parent_path();
    struct stat found{};
    if (stat(path.c_str(), &found) == 0 && !S_ISSOCK(found.st_mode))
        out.missing("publish socket", path + ": another file has this name", "remove it, or name another socket");
    else if (access(folder.c_str(), W_OK | X_OK) != 0)
        out.missing("publish socket", fmt::format("{}: {}", folder.string(), std::strerror(errno)),
                    fmt::format("mkdir -p {}, or name a socket in a folder of yours", folder.string()));
    else
        out.well("publish socket", path);
}

} // namespace

void check_outputs(findings& out, const live_config& config) {
    if (config.record.wanted) check_recording(out, config.record);
    const std::string& command = config.alarm.command;
    if (!command.empty() && may_execute(command))
        out.well("alarm command", command);
    else if (!command.empty())
        out.missing("alarm command", command + " is no program that may be executed",
                    fmt::format("chmod +x {}, or fix [alarm] command (a path without arguments)", command));
    if (!config.publish.socket.empty()) check_socket(out, config.publish.socket);
}

void check_processors(findings& out, const realtime_config& wanted) {
    if (wanted.cpus.empty()) return;
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
    std::string lacking;
    for (const int cpu : wanted.cpus)
        if (!CPU_ISSET(static_cast<std::size_t>(cpu), &allowed))
            lacking += fmt::format("{}{}", lacking.empty() ? "" : ", ", cpu);
    if (lacking.empty())
        out.well("processors", fmt::format("[realtime] cpus: all of {} may be used", wanted.cpus.size()));
    else
        out.missing("processors", fmt::format("[realtime] cpus: {} not here, or not for this user", lacking),
                    "name processors that grep Cpus_allowed_list /proc/self/status lists");
}

} // namespace okid_host
