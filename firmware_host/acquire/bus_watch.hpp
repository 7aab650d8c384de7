// SPDX-License-Identifier: MIT
// What happened on a bus between two looks at its counters, in words: link, bus-off, error states, losses.
#pragma once
#include <drv/source.h>

#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

struct bus_event {
    const char* kind; ///< link_down, link_up, bus_off, restarted, error_passive, driver_loss, socket_overflow, no_ack,
                      ///< no_packets, refused
    std::string text; ///< a sentence without the name of the interface
    bool urgent;      ///< to be shown on the terminal at once
};

class bus_watch {
  public:
    explicit bus_watch(std::string interface) : interface_(std::move(interface)) {}
    const std::string& interface() const { return interface_; }
    /// Compare with the last look. What floods (losses, missing acknowledgements) is urgent the first time only.
    std::vector<bus_event> look(const drv_stats_t& now);

  private:
    std::string interface_;
    drv_stats_t seen_{};
};

} // namespace okid_host
