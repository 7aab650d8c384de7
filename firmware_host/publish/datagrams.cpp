// SPDX-License-Identifier: MIT
#include "datagrams.hpp"

#include "error.hpp"
#include "peer.hpp"

#include <cstring>
#include <fmt/format.h>
#include <unistd.h>

namespace okid_host {

datagrams::datagrams(const net_address& to) : fd_(find_peer("[publish] udp", to, SOCK_DGRAM).connect_to(SOCK_DGRAM)) {
    if (fd_ < 0) throw failure(exit_device, fmt::format("[publish] udp {}: {}", to.text(), std::strerror(-fd_)));
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
