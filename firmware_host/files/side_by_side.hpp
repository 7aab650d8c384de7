// SPDX-License-Identifier: MIT
// Threads that do not disturb: no signal is delivered to them, and what they are given comes out the same for any number.
#pragma once
#include "signals_wait.hpp"

#include <cstddef>
#include <functional>
#include <thread>
#include <utility>

namespace okid_host {

/// A thread that no signal is delivered to.
template <class Run> std::thread quiet_thread(Run&& run) {
    const signals_wait until_it_runs;
    return std::thread(std::forward<Run>(run));
}

/// Call work(0) … work(count - 1), so many at a time and in this order; returns when all are done. Each call must leave the
/// others' results alone. The first exception is thrown again here, after the calls under way have ended.
/// @param threads  0: as many as the processors this process may use
void side_by_side(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

} // namespace okid_host
