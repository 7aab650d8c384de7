// SPDX-License-Identifier: MIT
// One JSON datagram an update, flat, as the UDP server of PlotJuggler reads it.
#pragma once
#include "config/config.hpp"
#include "flat_modes.hpp"

namespace okid_host {

class datagrams : public event_sink {
  public:
    /// Throws `failure` (exit 4) when the address cannot be found.
    explicit datagrams(const net_address& to);
    ~datagrams() override;
    datagrams(const datagrams&) = delete;
    datagrams& operator=(const datagrams&) = delete;
    void take(const publication& one) override;

  private:
    int fd_ = -1;
    live_numbers numbers_;
};

} // namespace okid_host
