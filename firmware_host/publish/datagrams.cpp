// SPDX-License-Identifier: MIT
#include "datagrams.hpp"

#include "peer.hpp"

#include <unistd.h>

namespace okid_host {

datagrams::datagrams(const net_address& to) : fd_(open_datagrams("[publish] udp", to)) {}

datagrams::~datagrams() { close(fd_); }

/// No receiver, or no room: the next update comes soon.
void datagrams::take(const publication& one) {
    numbers_.take(one);
    if (one.type != "modes") return;
    const std::string text = flat_json(numbers_);
    (void)!send(fd_, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
}

} // namespace okid_host
