// SPDX-License-Identifier: MIT
// What frames of live buses go to: a session that identifies, or one that only records.
#pragma once
#include "acquire/sender.hpp"
#include "align/stream_check.hpp"

#include <drv/frame.h>
#include <drv/source.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace okid_host {

/// What the devices counted themselves.
struct device_losses {
    std::uint64_t socket_overflow = 0, driver = 0;
};

/// Counts of a CAN controller and of the frames that okid sends, for the stats.
struct bus_health {
    drv_stats_t counts{};
    std::optional<sync_report> sync;
};

/// What the lamps show.
struct lamp_state {
    bool armed = false, go = false, alarm = false;
};

class stream_target {
  public:
    virtual ~stream_target() = default;
    virtual void frame(const drv_frame_t& frame) = 0;
    virtual void set_losses(std::size_t bus, const device_losses& losses) = 0;
    virtual void set_health(std::size_t bus, const bus_health& health) = 0;
    /// Something happened on a bus; reported once the stream has begun.
    virtual void bus_event(std::size_t bus, const char* kind, const std::string& text) = 0;
    /// Something happened to the recording.
    virtual void record_event(const std::string& kind, const std::string& text) = 0;
    /// An edge of the trigger line, host time (drv/host_clock.h). Ignored when none is waited for.
    virtual void trigger_edge(std::int64_t time_ns) = 0;
    virtual bool triggered() const = 0;
    virtual std::int64_t trigger_ns() const = 0; ///< when, once it has come; 0 without a trigger
    virtual lamp_state lamps() const = 0;
    virtual bool done() const = 0;
    virtual bool heard() const = 0;    ///< the stream has begun
    virtual stream_check& check() = 0; ///< what contradicts the configuration
    /// Every device is open; and, from then on at least every second: the thread that reads is at work. For a service manager.
    virtual void ready() {}
    /// @param caught_up  no frame waits that could be worked on
    virtual void alive(bool /*caught_up*/) {}
    virtual void finish() = 0;
};

} // namespace okid_host
