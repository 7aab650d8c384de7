// SPDX-License-Identifier: MIT
// Threads that serve the devices and the disk: signals are the main thread's, and where the system lets us they come
// before everything that computes.
#pragma once
#include "config/config.hpp"
#include "files/side_by_side.hpp"

namespace okid_host {

/// SCHED_FIFO and CPUs as [realtime] has them. What the config asks for and the system refuses is said on stderr, once a
/// cause, with the remedy; the default priority may be refused in silence.
/// @param share  of the priority: 1 for what must not wait, less for what has a buffer
void put_first(std::thread& thread, const realtime_config& wanted, double share = 1);

/// Keep what is in memory there, now and from now on, when [realtime] lock_memory asks for it.
void lock_memory(const realtime_config& wanted);

} // namespace okid_host
