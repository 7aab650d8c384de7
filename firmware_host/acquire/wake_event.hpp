// SPDX-License-Identifier: MIT
// Many threads signal to one that something waits for it. Only the first of them writes; the others see that it did.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace okid_host {

class wake_event {
  public:
    wake_event() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
    ~wake_event() { close(fd_); }
    wake_event(const wake_event&) = delete;
    wake_event& operator=(const wake_event&) = delete;

    /// After what is to be found was put in place.
    void signal() {
        if (is_set_.exchange(true, std::memory_order_acq_rel)) return;
        const std::uint64_t one = 1;
        (void)!write(fd_, &one, sizeof one);
    }
    /// Until a signal, until one of the others (negative = none) can be read, or for timeout_ms; then look for all there is.
    void wait(int timeout_ms, int other = -1, int another = -1) {
        std::array<pollfd, 3> waits{{{fd_, POLLIN, 0}, {other, POLLIN, 0}, {another, POLLIN, 0}}};
        (void)poll(waits.data(), waits.size(), timeout_ms);
        std::uint64_t count = 0;
        (void)!read(fd_, &count, sizeof count);
        // Last: a signal before it needs no write, one after it writes.
        (void)is_set_.exchange(false, std::memory_order_acq_rel);
    }

  private:
    int fd_;
    std::atomic<bool> is_set_{false};
};

} // namespace okid_host
