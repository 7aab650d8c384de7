// SPDX-License-Identifier: MIT
// Events in the line protocol of InfluxDB: measurement,tags fields nanoseconds.
#pragma once
#include "flat_modes.hpp"

namespace okid_host {

class influx_lines {
  public:
    /// @param rig  value of the tag `rig` on every line
    explicit influx_lines(std::string rig) : rig_(std::move(rig)) {}
    /// The lines that an event makes, each with its line end; "" for events that make none.
    /// modes: okid_mode for each tracked mode and okid; stats: okid_bus, okid_channel; alarm, alarm_over, change: okid_event
    std::string take(const publication& one);

  private:
    std::string head(const char* measurement, const std::string& tag = "", const std::string& value = "") const;

    std::string rig_;
    live_numbers numbers_;
};

} // namespace okid_host
