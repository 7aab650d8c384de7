// SPDX-License-Identifier: MIT
// What okid itself sends while it listens: start frames once, then SYNC at absolute deadlines from a thread of its own.
#pragma once
#include "config/config.hpp"

#include <drv/pacer.h>
#include <drv/sink.h>

#include <atomic>
#include <mutex>
#include <thread>

namespace okid_host {

/// How the SYNC frames of a bus went.
struct sync_report {
    std::uint64_t sent = 0, missed = 0; ///< missed: a deadline that could not be met by its successor, or not sent
    double late_mean_us = 0, late_sd_us = 0, late_worst_us = 0;
    std::string error; ///< of the last frame that could not be sent, "" = none
};

class sync_sender {
  public:
    /// Opens the interface. Throws `failure` (exit 4).
    explicit sync_sender(const bus_config& bus);
    ~sync_sender();
    sync_sender(const sync_sender&) = delete;
    sync_sender& operator=(const sync_sender&) = delete;

    /// Send the start frames, then begin with SYNC. Throws `failure` (exit 4) when a start frame cannot be sent.
    void start(const realtime_config& realtime);
    void stop();
    sync_report report() const;

  private:
    void run();
    bool send(const drv_frame_t& frame, int patience_ms);

    const bus_config& bus_;
    drv_sink_t sink_{};
    std::thread thread_;
    std::atomic<bool> stopping_{false};
    mutable std::mutex mutex_;
    sync_report report_;
};

} // namespace okid_host
