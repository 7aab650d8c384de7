// SPDX-License-Identifier: MIT
#include "datagrams.hpp"

#include "error.hpp"

#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

namespace okid_host {

datagrams::datagrams(const net_address& to) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = AI_NUMERICSERV;
    const int status = getaddrinfo(to.host.c_str(), std::to_string(to.port).c_str(), &hints, &found);
    if (status != 0)
        throw failure(exit_device, fmt::format("[publish] udp {}: {}", to.text(),
                                               status == EAI_SYSTEM ? std::strerror(errno) : gai_strerror(status)));
    fd_ = socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const bool well = fd_ >= 0 && connect(fd_, found->ai_addr, found->ai_addrlen) == 0;
    const int why = errno;
    freeaddrinfo(found);
    if (well) return;
    if (fd_ >= 0) close(fd_);
    throw failure(exit_device, fmt::format("[publish] udp {}: {}", to.text(), std::strerror(why)));
}

datagrams::~datagrams() { close(fd_); }

/// Nobody there, or no room: the next update comes soon.
void datagrams::take(const publication& one) {
    numbers_.take(one);
    if (one.type != "modes") return;
    const std::string text = flat_json(numbers_);
    (void)!send(fd_, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
}

} // namespace okid_host
