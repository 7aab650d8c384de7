// SPDX-License-Identifier: MIT
// One live session: frames in, events and a result out. Everything happens by count of samples, nothing by the clock, so
// that a recorded stream gives the same result at every speed.
#pragma once
#include "../config.hpp"
#include "../result.hpp"
#include "events.hpp"
#include "grid.hpp"
#include "identifier.hpp"
#include "sender.hpp"
#include "settling.hpp"
#include "trigger.hpp"

#include <cstdint>
#include <drv/clock_fit.h>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

struct session_options {
    std::optional<double> duration_s;       ///< stream seconds
    std::string events, json;               ///< files, "-" = stdout, "" = none
    std::optional<std::int64_t> trigger_ns; ///< a log holds no edge of a GPIO line: when it came
};

/// What the devices counted themselves.
struct device_losses {
    std::uint64_t socket_overflow = 0, driver = 0;
};

/// What a CAN controller and the frames okid sends have to tell, for the stats.
struct bus_health {
    drv_stats_t counts{};
    std::optional<sync_report> sync;
};

/// What the lamps show.
struct lamp_state {
    bool armed = false, go = false, alarm = false;
};

class session : private grid_sink {
  public:
    session(const live_config& config, const session_options& options);

    void frame(const drv_frame_t& frame);
    void set_losses(std::size_t bus, const device_losses& losses) { losses_[bus] = losses; }
    void set_health(std::size_t bus, const bus_health& health) { health_[bus] = health; }
    /// Something happened on a bus; told once the stream has begun.
    void bus_event(std::size_t bus, const char* kind, const std::string& text);
    /// An edge of the trigger line, CLOCK_REALTIME. Nothing comes of it when the session does not wait for one.
    void trigger_edge(std::int64_t time_ns);
    bool triggered() const { return !trigger_.waiting(); }
    lamp_state lamps() const;
    bool done() const { return limit_ > 0 && grid_.emitted() >= limit_; }
    double stream_s() const { return static_cast<double>(grid_.emitted()) / config_.rate_hz; }
    bool heard() const { return started_; }

    /// Final stats, then result and table. Throws `failure` (exit 3) when no model can be had: then there is no result.
    void finish();

  private:
    void on_sample(std::int64_t index, const double* row) override;
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap& gap) override;

    void start(std::int64_t time_ns);
    void begin(std::int64_t until);
    void update(std::int64_t samples);
    void show_modes(std::int64_t samples);
    void write_stats();
    void check_heard() const;
    nlohmann::ordered_json bus_stats(std::size_t bus) const;
    result_context context();
    void add_mass(result_context& about) const;
    double observed_rate_hz() const;
    void remark_rate() const;
    double seconds(std::int64_t samples) const { return static_cast<double>(samples) / config_.rate_hz; }

    const live_config& config_;
    session_options options_;
    event_stream events_;
    live_view view_;
    grid grid_;
    identifier identifier_;
    settling settling_;
    trigger trigger_;
    std::vector<device_losses> losses_;
    std::vector<std::optional<bus_health>> health_;
    std::vector<drv_clock_fit_t> clocks_; ///< of the devices that stamp frames themselves
    std::vector<double> busy_s_;          ///< time on the wire of each bus, 0 without a bitrate
    std::int64_t update_samples_, stats_samples_, limit_ = 0, now_ = 0;
    std::int64_t first_ns_ = 0, last_ns_ = 0; ///< time stamps of the stream
    std::int64_t gaps_ = 0;
    bool started_ = false, settled_ = false;
};

} // namespace okid_host
