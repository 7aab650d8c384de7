// SPDX-License-Identifier: MIT
// Recorded logs: through a session, or onto a bus, as fast as possible or at a multiple of their own time.
#pragma once
#include "journal/recorder.hpp"
#include "stream_target.hpp"

#include <drv/pacer.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>

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

/// A name that ends in .okj, in any case of letters.
bool is_journal(const std::string& path);

/// Interfaces of a log, each once, in order of appearance.
/// @param enough  the first of these is the last that is looked for
std::vector<std::string> interfaces_of(const std::string& log, const std::vector<std::string>& enough = {});

/// Called now and then with how much of a log was read, 0 to 1; below 0 = not known (a pipe).
using read_share = std::function<void(double share)>;

/// Frames of a log or of a journal and the segments behind it, one after the other. Throws `failure` (exit 2) at a line
/// that does not parse; what is damaged in a journal is reported on stderr at its end.
class log_frames {
  public:
    /// Every frame; of a journal with the bus it was recorded with, of a log as bus 0.
    explicit log_frames(const std::string& path);
    /// Those of the buses of a config: by the name of the bus (journal) or the interface; the only one feeds the only
    /// one. Throws `failure` (exit 2) naming what is there when none fits.
    log_frames(const std::string& path, const live_config& config);
    /// Those of interfaces of a log; the place in the list is the bus of a frame.
    log_frames(const std::string& path, const std::vector<std::string>& interfaces);
    ~log_frames();
    log_frames(const log_frames&) = delete;
    log_frames& operator=(const log_frames&) = delete;
    /// The next frame, NULL at the end.
    const drv_frame_t* next();
    /// Who is called after every batch that was read.
    void on_share(read_share call) { on_share_ = std::move(call); }

  private:
    void open(const std::vector<std::string>& interfaces);
    void measure();
    void tell_damage();
    double share() const;

    std::string path_;
    read_share on_share_;
    std::vector<double> sizes_; ///< bytes of each file
    drv_source_t source_{};
    bool reported_ = false;
    std::vector<int> bus_of_; ///< of each bus of a journal, -1 = not wanted; empty = as it was
    std::vector<drv_frame_t> batch_;
    int at_ = 0, count_ = 0;
};

/// A log holds no edges of a GPIO line: throws `failure` (exit 2) when the config waits for one and none is given.
void require_edge_time(const live_config& config, bool given);

/// Play a log through a target; finishing it is the caller's. Signals are caught already. Throws `failure`.
void play_through(const std::string& log, const live_config& config, stream_target& target, std::optional<double> speed,
                  const std::optional<recorder_options>& recording, const read_share& on_share = {});

/// Play every frame of a log onto an interface. Throws `failure`: exit 2 for the log, exit 4 for the interface.
void play_onto_bus(const std::string& log, const std::string& interface, std::optional<double> speed,
                   const read_share& on_share = {});

} // namespace okid_host
