// SPDX-License-Identifier: MIT Accepts clients of a listening socket. The last descriptors are the run's own, for its
// result, the next segment of its journal or a device that comes back: a visitor that would take one of them is turned
// away.
#pragma once

namespace okid_host {

/// @return a descriptor that does not block, or -1 with errno (EAGAIN: no client waits)
int next_visitor(int listening);

} // namespace okid_host
