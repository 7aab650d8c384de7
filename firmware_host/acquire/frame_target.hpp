// SPDX-License-Identifier: MIT
// Where frames are played to: a CAN interface, or an slcan adapter on a serial device.
#pragma once
#include <drv/sink.h>
#include <drv/slcan.h>

#include <cstdint>
#include <string>

namespace okid_host {

class frame_target {
  public:
    /// A name with a '/' is a device; its adapter keeps the bit rate it has. Throws `failure` (exit 4).
    explicit frame_target(const std::string& name);
    ~frame_target();
    frame_target(const frame_target&) = delete;
    frame_target& operator=(const frame_target&) = delete;

    /// Throws `failure` (exit 4) when the frame cannot be sent for two seconds.
    void write(const drv_frame_t& frame);
    std::uint64_t sent() const { return device_ ? adapter_.sent : interface_.sent; }

  private:
    std::string name_;
    bool device_;
    drv_sink_t interface_{};
    drv_slcan_sink_t adapter_{};
};

} // namespace okid_host
