// SPDX-License-Identifier: MIT
// The other end of a socket, looked up once.
#pragma once
#include "config/config.hpp"

#include <sys/socket.h>

namespace okid_host {

struct peer {
    sockaddr_storage address{};
    socklen_t length = 0;

    /// @return a non-blocking socket whose connection is made or under way; throws nothing: -errno
    int connect_to(int kind) const;
};

/// @param what  how messages name it, such as "[publish] udp"; @param kind  SOCK_DGRAM or SOCK_STREAM
/// Throws `failure` (exit 4) when the address cannot be found.
peer find_peer(const char* what, const net_address& to, int kind);

/// @return a non-blocking socket for datagrams. Throws as find_peer(), and when there is no way to the address.
int open_datagrams(const char* what, const net_address& to);

} // namespace okid_host
