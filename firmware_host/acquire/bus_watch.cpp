// SPDX-License-Identifier: MIT
#include "bus_watch.hpp"

#include <fmt/format.h>

namespace okid_host {
namespace {

std::string bus_off_text(const std::string& interface, const drv_stats_t& now) {
    if (now.restart_ms > 0) return fmt::format("bus-off; it restarts by itself after {} ms", now.restart_ms);
    return fmt::format("bus-off, and restart-ms is 0: it stays off until sudo ip link set {0} type can restart (by "
                       "itself: sudo ip link set {0} down && sudo ip link set {0} up type can restart-ms 100). Look "
                       "for a wrong bit rate, a missing terminator or a short circuit",
                       interface);
}

} // namespace

std::vector<bus_event> bus_watch::look(const drv_stats_t& now) {
    std::vector<bus_event> out;
    const auto more = [&](std::uint64_t drv_stats_t::* count) { return now.*count > seen_.*count; };
    const auto first = [&](std::uint64_t drv_stats_t::* count) { return seen_.*count == 0; };
    if (more(&drv_stats_t::link_down)) out.push_back({"link_down", "went down or away; waiting for it", true});
    if (!now.link_is_down && (seen_.link_is_down || more(&drv_stats_t::link_down)))
        out.push_back({"link_up", "is up again", true});
    if (more(&drv_stats_t::bus_off))
        out.push_back({"bus_off", bus_off_text(now.interface[0] ? now.interface : interface_, now), true});
    if (more(&drv_stats_t::restarts)) out.push_back({"restarted", "restarted after bus-off", true});
    if (more(&drv_stats_t::error_passive))
        out.push_back(
            {"error_passive", fmt::format("error-passive: {}", now.last_error), first(&drv_stats_t::error_passive)});
    if (more(&drv_stats_t::lost_driver))
        out.push_back({"driver_loss",
                       fmt::format("the driver or the controller lost frames, {} in all: the computer is too slow for "
                                   "this bus",
                                   now.lost_driver),
                       first(&drv_stats_t::lost_driver)});
    if (more(&drv_stats_t::lost_overflow))
        out.push_back(
            {"socket_overflow",
             fmt::format(
                 "{} frames lost in all, the receive buffer ({} bytes) was full; okid doctor shows how to enlarge it",
                 now.lost_overflow, now.buffer_bytes),
             first(&drv_stats_t::lost_overflow)});
    if (more(&drv_stats_t::no_ack))
        out.push_back({"no_ack", "no node acknowledges what is sent: is another one on the bus, at this bit rate?",
                       first(&drv_stats_t::no_ack)});
    constexpr std::uint64_t plenty = 2000; // bytes: longer than any packet and any line
    if (now.received == 0 && now.bytes >= plenty && seen_.bytes < plenty)
        out.push_back({"no_packets",
                       "bytes arrive, but nothing that could be read: is the baud rate or the framing wrong?", true});
    // Closing a channel that is closed is refused, too: the first time after each opening says nothing.
    if (more(&drv_stats_t::refused) && now.refused > 1 + now.reopened)
        out.push_back({"refused", "the adapter refuses a command: does it know this bit rate?",
                       seen_.refused <= 1 + seen_.reopened});
    seen_ = now;
    return out;
}

} // namespace okid_host
