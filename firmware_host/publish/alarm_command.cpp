// SPDX-License-Identifier: MIT
#include "alarm_command.hpp"

#include "config/config_alarm.hpp"
#include "error.hpp"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace okid_host {

alarm_command::alarm_command(const std::string& path) : path_(path) {
    if (!may_execute(path))
        throw failure(exit_usage,
                      fmt::format("[alarm] command {}: expected a program that may be executed: a path, without "
                                  "arguments; check that it is there and chmod +x it",
                                  path));
}

void alarm_command::take(const publication& one) {
    const bool changed = one.type == "change_test" && one.event->value("alarm", false);
    if (one.type != "alarm" && !changed) return;
    waiting_ = one.line;
    tick();
}

/// Standard input is a socket, so that a program which does not read it cannot end us by SIGPIPE; standard output, which
/// may carry events, is the standard error of okid.
void alarm_command::start(const std::string& text) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return;
    posix_spawn_file_actions_t files;
    posix_spawnattr_t how;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawnattr_init(&how);
    sigset_t all, none;
    sigfillset(&all);
    sigemptyset(&none);
    posix_spawnattr_setsigdefault(&how, &all);
    posix_spawnattr_setsigmask(&how, &none);
    posix_spawnattr_setpgroup(&how, 0); // Ctrl-C is not meant for it
    posix_spawnattr_setflags(&how, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    char* const arguments[] = {path_.data(), nullptr};
    const int status = posix_spawn(&child_, path_.c_str(), &files, &how, arguments, environ);
    posix_spawnattr_destroy(&how);
    posix_spawn_file_actions_destroy(&files);
    (void)!send(ends[0], text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    close(ends[0]);
    close(ends[1]);
    if (status != 0) {
        child_ = 0;
        say("okid: [alarm] command {}: {}\n", path_, std::strerror(status));
        return;
    }
    ended_ = false;
    started_ = std::chrono::steady_clock::now();
}

void alarm_command::tick() {
    int status = 0;
    const pid_t ended = child_ > 0 ? waitpid(child_, &status, WNOHANG) : 0;
    if (ended != 0) { // -1: somebody else has waited for it
        if (ended > 0 && WIFEXITED(status) && WEXITSTATUS(status) != 0)
            say("okid: [alarm] command {}: ended with exit code {}\n", path_, WEXITSTATUS(status));
        child_ = 0;
    }
    const std::chrono::duration<double> ran = std::chrono::steady_clock::now() - started_;
    if (child_ > 0 && !ended_ && ran.count() > limit_s) {
        say("okid: [alarm] command {}: killed after {:g} s\n", path_, limit_s);
        kill(-child_, SIGKILL);
        ended_ = true;
    }
    if (child_ == 0 && waiting_) start(*std::exchange(waiting_, nullptr));
}

bool alarm_command::finished() {
    tick();
    return child_ == 0 && !waiting_;
}

} // namespace okid_host
