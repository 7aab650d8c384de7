// SPDX-License-Identifier: MIT
// Hears for a second everything on an interface, to say what comes where an asked-for identifier does not: the socket of
// the capture lets nothing else pass.
#pragma once
#include "align/stream_check.hpp"
#include "config/config.hpp"

#include <drv/source.h>

#include <array>
#include <cstdint>

namespace okid_host {

class bus_listener {
  public:
    /// An interface that cannot be opened is not heard: the capture says why.
    bus_listener(const bus_config& config, std::size_t bus);
    ~bus_listener();
    bus_listener(const bus_listener&) = delete;
    bus_listener& operator=(const bus_listener&) = delete;

    /// What waits, at most a few hundred frames.
    void take(stream_check& check);

  private:
    drv_source_t source_{};
    std::uint8_t bus_;
    bool open_;
    std::array<drv_frame_t, 64> frames_;
};

} // namespace okid_host
