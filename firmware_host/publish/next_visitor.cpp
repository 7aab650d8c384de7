// SPDX-License-Identifier: MIT
// PURPOSE  visitors for a server that shares its descriptors with a measurement
// METHOD   accept() gives the lowest free descriptor: one near the limit says how many are left
#include "next_visitor.hpp"

#include <algorithm>
#include <cerrno>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

namespace okid_host {
namespace {

/// Descriptors from here on are not for visitors.
rlim_t first_kept() {
    constexpr rlim_t most_kept = 16;
    rlimit limit{};
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 0;
    return limit.rlim_cur - std::min(limit.rlim_cur / 4, most_kept);
}

} // namespace

int next_visitor(int listening) {
    for (;;) {
        const int fd = accept4(listening, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0 && (errno == EINTR || errno == ECONNABORTED)) continue;
        if (fd < 0 || static_cast<rlim_t>(fd) < first_kept()) return fd;
        close(fd);
    }
}

} // namespace okid_host
