// SPDX-License-Identifier: MIT
// The GPIO lines of a live run: the trigger input and the lamps.
#pragma once
#include "config/config.hpp"
#include "stream_target.hpp"

#include <drv/gpio.h>

#include <memory>
#include <string>

namespace okid_host {

class gpio_lines {
  public:
    /// Takes every line of the config. Throws `failure` (exit 4) that says what is there and what to do.
    explicit gpio_lines(const live_config& config);
    /// Switches the lamps off and releases the lines.
    ~gpio_lines();
    gpio_lines(const gpio_lines&) = delete;
    gpio_lines& operator=(const gpio_lines&) = delete;

    /// To poll for edges, -1 without a trigger line.
    int fd() const { return trigger_ ? drv_gpio_fd(trigger_.get()) : -1; }
    /// Hands waiting edges to the session and its state to the lamps.
    void serve(stream_target& live);

  private:
    using line = std::unique_ptr<drv_gpio_t, void (*)(drv_gpio_t*)>;
    void read_edges(stream_target& live);
    void show(const lamp_state& state);

    line trigger_, armed_, go_, alarm_;
    lamp_state shown_;
};

/// Is the line free? "" or what was found; it is opened for a moment. @param remedy  out: what to do
std::string gpio_fault(const gpio_place& place, bool output, drv_gpio_edge_t edge, std::string& remedy);

} // namespace okid_host
