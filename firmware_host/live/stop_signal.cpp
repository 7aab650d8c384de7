// SPDX-License-Identifier: MIT
#include "stop_signal.hpp"

#include <atomic>
#include <csignal>
#include <cstdint>
#include <sys/eventfd.h>
#include <unistd.h>

namespace okid_host {
namespace {

std::atomic<bool> requested{false};
int event_fd = -1;

void on_signal(int) {
    if (requested.exchange(true)) _exit(130);
    const std::uint64_t one = 1;
    if (event_fd >= 0) (void)!write(event_fd, &one, sizeof one);
}

} // namespace

void catch_stop_signals() {
    if (event_fd < 0) event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    struct sigaction action{};
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

bool stop_requested() { return requested.load(std::memory_order_relaxed); }
int stop_fd() { return event_fd; }

} // namespace okid_host
