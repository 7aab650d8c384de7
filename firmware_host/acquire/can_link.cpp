// SPDX-License-Identifier: MIT
#include "can_link.hpp"

#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int fd_mtu = 72;
constexpr std::uint32_t usual_bitrate = 1000000, short_queue = 100;

/// Down, settings, up: what a running controller does not take.
std::string set_again(const bus_config& bus, const drv_link_t& link) {
    const double bitrate = bus.bitrate.value_or(link.bitrate ? link.bitrate : usual_bitrate);
    std::string out = fmt::format("sudo ip link set {0} down; sudo ip link set {0} up type can bitrate {1:.0f}",
                                  bus.interface, bitrate);
    if (bus.fd && (bus.dbitrate || link.dbitrate))
        out += fmt::format(" dbitrate {:.0f} fd on", bus.dbitrate.value_or(link.dbitrate));
    return out + " restart-ms 100";
}

std::string state_text(const drv_link_t& link) {
    std::string out = link.up ? "up" : "is down";
    if (link.bitrate) out += fmt::format(", {} bit/s", link.bitrate);
    if (link.dbitrate) out += fmt::format(" (data {} bit/s)", link.dbitrate);
    if (link.state != DRV_BUS_UNKNOWN && link.up) out += fmt::format(", {}", drv_bus_state_name(link.state));
    if (link.has_error_counters && (link.tx_errors || link.rx_errors))
        out += fmt::format(", error counters tx {} rx {}", link.tx_errors, link.rx_errors);
    return out;
}

void judge_settings(const bus_config& bus, const drv_link_t& link, std::vector<link_finding>& out) {
    const std::string state = state_text(link);
    if (bus.fd && link.mtu < fd_mtu)
        out.push_back({"up, but its mtu carries no FD frames",
                       link.has_can_data
                           ? set_again(bus, link)
                           : fmt::format("sudo ip link set {0} down; sudo ip link set {0} mtu 72 up", bus.interface),
                       true});
    if (link.bitrate && bus.bitrate && static_cast<double>(link.bitrate) != *bus.bitrate)
        out.push_back({fmt::format("{}, expected {:.0f} bit/s", state, *bus.bitrate), set_again(bus, link), true});
    if (bus.fd && link.dbitrate && bus.dbitrate && static_cast<double>(link.dbitrate) != *bus.dbitrate)
        out.push_back(
            {fmt::format("{}, expected {:.0f} bit/s for data", state, *bus.dbitrate), set_again(bus, link), true});
    const bool sends = bus.sync_hz || !bus.start_frames.empty();
    if (sends && link.listen_only)
        out.push_back(
            {"is listen-only, but the config sends (sync_hz, start)",
             fmt::format("sudo ip link set {0} down; sudo ip link set {0} up type can listen-only off", bus.interface),
             true});
    if (link.has_can_data && link.tx_queue < short_queue)
        out.push_back({fmt::format("txqueuelen is {}: bursts that are sent find the queue full", link.tx_queue),
                       fmt::format("sudo ip link set {} txqueuelen 1000", bus.interface), sends});
}

} // namespace

std::vector<link_finding> judge_link(const bus_config& bus, const drv_link_t& link) {
    std::vector<link_finding> out;
    if (!link.is_can) return {{"exists, but is no CAN interface", "correct interface in the [[bus]]", true}};
    if (!link.up) {
        const std::string up = fmt::format("sudo ip link set {} up", bus.interface);
        return {{state_text(link), link.kind == std::string("can") ? set_again(bus, link) : up, true}};
    }
    if (link.state == DRV_BUS_OFF)
        out.push_back({state_text(link) +
                           ": it neither sends nor receives. A wrong bit rate, a missing terminator or a "
                           "short circuit?",
                       fmt::format("sudo ip link set {} type can restart", bus.interface), true});
    judge_settings(bus, link, out);
    if (out.empty() || !out.front().missing) out.insert(out.begin(), {state_text(link), "", false});
    if (link.state == DRV_BUS_PASSIVE || link.state == DRV_BUS_WARNING)
        out.push_back(
            {fmt::format("{}: many errors on the wire; check bit rate and terminators", drv_bus_state_name(link.state)),
             "", false});
    if (link.has_can_data && link.restart_ms == 0)
        out.push_back({"restart-ms is 0: the bus stays off after bus-off", set_again(bus, link), false});
    if (link.rx_dropped + link.rx_over_errors > 0)
        out.push_back({fmt::format("since it exists the driver dropped {} frames, the controller overran {} times",
                                   link.rx_dropped, link.rx_over_errors),
                       "", false});
    return out;
}

} // namespace okid_host
