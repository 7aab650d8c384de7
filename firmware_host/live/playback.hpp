// SPDX-License-Identifier: MIT
// Recorded logs: through a session, or onto a bus, as fast as possible or at a multiple of their own time.
#pragma once
#include "session.hpp"

#include <drv/pacer.h>

#include <optional>
#include <string>

namespace okid_host {

/// Absolute deadlines: frame n is due at start + (its stamp - first stamp) / speed. Without speed nothing waits.
class pacer {
  public:
    explicit pacer(std::optional<double> speed) : speed_(speed) {}
    /// Sleep until the stamp is due. @return false when a stop was asked for
    bool wait_for(std::int64_t time_ns);
    /// How late the frames were.
    const drv_pacer_t& lateness() const { return timing_; }

  private:
    std::optional<double> speed_;
    bool begun_ = false;
    std::int64_t first_ns_ = 0;
    drv_pacer_t timing_{};
};

/// Which interface of the log feeds which bus: by name; a log with one interface feeds the only CAN bus.
/// Throws `failure` (exit 2) naming the interfaces of the log when none fits.
std::vector<std::string> map_interfaces(const std::string& log, const live_config& config);

/// Frames of a log, one after the other. Throws `failure` (exit 2) at a line that does not parse.
class log_frames {
  public:
    log_frames(const std::string& path, const std::vector<std::string>& interfaces);
    ~log_frames();
    log_frames(const log_frames&) = delete;
    log_frames& operator=(const log_frames&) = delete;
    /// The next frame, NULL at the end.
    const drv_frame_t* next();

  private:
    drv_source_t source_{};
    bool told_torn_ = false;
    std::vector<drv_frame_t> batch_;
    int at_ = 0, count_ = 0;
};

/// Play a log through a session and finish it. Throws `failure`.
void play_through_session(const std::string& log, const live_config& config, const session_options& options,
                          std::optional<double> speed);

/// Play every frame of a log onto an interface. Throws `failure`: exit 2 for the log, exit 4 for the interface.
void play_onto_bus(const std::string& log, const std::string& interface, std::optional<double> speed);

} // namespace okid_host
