// SPDX-License-Identifier: MIT
#include "peer.hpp"

#include "error.hpp"

#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <netdb.h>
#include <unistd.h>

namespace okid_host {

peer find_peer(const char* what, const net_address& to, int kind) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = kind;
    hints.ai_flags = AI_NUMERICSERV;
    const int status = getaddrinfo(to.host.c_str(), std::to_string(to.port).c_str(), &hints, &found);
    if (status != 0)
        throw failure(exit_device, fmt::format("{} {}: {}", what, to.text(),
                                               status == EAI_SYSTEM ? std::strerror(errno) : gai_strerror(status)));
    peer out;
    out.length = found->ai_addrlen;
    std::memcpy(&out.address, found->ai_addr, found->ai_addrlen);
    freeaddrinfo(found);
    return out;
}

int open_datagrams(const char* what, const net_address& to) {
    const int fd = find_peer(what, to, SOCK_DGRAM).connect_to(SOCK_DGRAM);
    if (fd < 0) throw failure(exit_device, fmt::format("{} {}: {}", what, to.text(), std::strerror(-fd)));
    return fd;
}

int peer::connect_to(int kind) const {
    const int fd = socket(address.ss_family, kind | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) return -errno;
    if (connect(fd, reinterpret_cast<const sockaddr*>(&address), length) == 0 || errno == EINPROGRESS) return fd;
    const int why = errno;
    close(fd);
    return -why;
}

} // namespace okid_host
