// SPDX-License-Identifier: MIT
// GET /metrics: the newest numbers as Prometheus reads them. Only in builds with prometheus-cpp.
#pragma once
#include "config/config.hpp"
#include "flat_modes.hpp"

#include <functional>
#include <memory>

namespace okid_host {

/// What is in no event.
struct publisher_figures {
    double update_s = 0, update_worst_s = 0;             ///< how long the newest update took, and the longest
    std::uint64_t updates = 0, skipped = 0, dropped = 0; ///< dropped: events that no sink could be given
};

/// Throws `failure` (exit 4) when the address cannot be listened on, exit 2 in a build without.
std::unique_ptr<event_sink> make_metrics(const net_address& at, std::function<publisher_figures()> figures);

} // namespace okid_host
