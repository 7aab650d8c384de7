// SPDX-License-Identifier: MIT
#include "stop_signal.hpp"

#include <atomic>
#include <csignal>
#include <cstdint>
#include <sys/eventfd.h>
#include <unistd.h>

namespace okid_host {
namespace {

std::atomic<bool> requested{false}, interrupted{false};
std::atomic<int> hangups{0};
int event_fd = -1;

void wake() {
    const std::uint64_t one = 1;
    if (event_fd >= 0) (void)!write(event_fd, &one, sizeof one);
}

void on_signal(int) {
    if (interrupted.exchange(true)) _exit(130);
    requested.store(true);
    wake();
}

void on_hangup(int, siginfo_t* from, void*) {
    if (from->si_code <= 0) { // sent by a process
        hangups.fetch_add(1);
        return;
    }
    requested.store(true);
    wake();
}

} // namespace

void catch_stop_signals() {
    if (event_fd < 0) event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    struct sigaction action{};
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGPIPE, SIG_IGN); // who no longer reads stdout or a socket ends no measurement
    std::signal(SIGCHLD, SIG_DFL); // else the end of an alarm command could not be waited for
}

bool stop_requested() { return requested.load(std::memory_order_relaxed); }
int stop_fd() { return event_fd; }

void catch_hangups() {
    struct sigaction action{}, before{};
    action.sa_sigaction = on_hangup;
    action.sa_flags = SA_SIGINFO | SA_RESTART;
    sigemptyset(&action.sa_mask);
    if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler == SIG_IGN) return; // nohup
    sigaction(SIGHUP, &action, nullptr);
}

int reopen_requests() { return hangups.load(); }

} // namespace okid_host
