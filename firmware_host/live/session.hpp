// SPDX-License-Identifier: MIT
// One live session: frames in, events and a result out. Everything happens by count of samples, nothing by the clock, so
// that a recorded stream gives the same result at every speed.
#pragma once
#include "align/aligner.hpp"
#include "align/rate_meter.hpp"
#include "align/trigger.hpp"
#include "config/config.hpp"
#include "hammer.hpp"
#include "publish/publisher.hpp"
#include "publish/sample_feed.hpp"
#include "relief.hpp"
#include "result/result.hpp"
#include "silence_watch.hpp"
#include "stream_target.hpp"
#include "update_thread.hpp"
#include "virtual_channels.hpp"

#include <array>
#include <cstdint>
#include <drv/clock_fit.h>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// An observer beside files and terminals: gets every sample and gap of the grid, every event as a line.
class session_listener : public grid_sink {
  public:
    virtual void on_event(const std::string& line) = 0;
    virtual bool wants_events() const { return true; } ///< of a whole run
    /// The samples up to here are with the thread that makes the updates.
    virtual void on_handed_over(std::int64_t /*samples*/) {}
};

struct session_options {
    std::optional<double> duration_s;       ///< stream seconds
    std::string events, json;               ///< files, "-" = stdout, "" = none
    std::optional<std::int64_t> trigger_ns; ///< a log holds no edge of a GPIO line: when it came
    bool live = false;                      ///< from devices: the clock does not wait, and a service manager may
    bool identify = true;                   ///< false: samples, gaps and counts only; no trigger, no result
    bool table = true;                      ///< modes and result on stdout, unless something else goes there
    session_listener* listener = nullptr;
    std::size_t most_waiting = update_thread::most_waiting; ///< numbers that may wait for the mathematics
};

class session : public stream_target, private grid_sink {
  public:
    session(const live_config& config, const session_options& options);

    void frame(const drv_frame_t& frame) override;
    void set_losses(std::size_t bus, const device_losses& losses) override { losses_[bus] = losses; }
    void set_health(std::size_t bus, const bus_health& health) override {
        health_[bus] = health;
        grid_.set_link(bus, health.counts.link_is_down != 0);
    }
    void bus_event(std::size_t bus, const char* kind, const std::string& text) override;
    void record_event(const std::string& kind, const std::string& text) override;
    void trigger_edge(std::int64_t time_ns) override;
    std::int64_t trigger_ns() const override { return trigger_.time_ns(); }
    bool triggered() const override { return !trigger_.waiting(); }
    lamp_state lamps() const override;
    bool done() const override { return (limit_ > 0 && grid_.emitted() >= limit_) || hammer_.done(); }
    nlohmann::ordered_json stats_event() const; ///< the counts by now
    double stream_s() const { return static_cast<double>(grid_.emitted()) / config_.rate_hz; }
    bool heard() const override { return started_; }
    stream_check& check() override { return check_; }
    void ready() override;
    void alive(bool caught_up) override;

    /// Final stats, then result and table. Throws `failure` (exit 3) when no model is possible: then there is no
    /// result.
    void finish() override;

  private:
    void on_sample(std::int64_t index, const double* row) override;
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap& gap) override;

    void tell(nlohmann::ordered_json event);
    void start(std::int64_t time_ns);
    void begin(std::int64_t until);
    void strike();
    void tell_silent(std::size_t channel, std::int64_t first);
    void update(std::int64_t samples);
    void await(std::int64_t samples);
    void hand_over(std::int64_t samples);
    void tell_updates(std::vector<update_report> reports);
    void count_update(const update_report& report);
    void overload(overload_step step, bool on);
    void send_samples(const json_line& block);
    void bridge(std::int64_t index, std::int64_t count);
    void open_virtual();
    std::string silence(std::size_t index) const;
    void check_heard() const;
    nlohmann::ordered_json bus_stats(std::size_t bus) const;
    result_context context();
    void remark_converted(result_context& about) const;
    double observed_rate_hz() const { return now_ >= 100 ? rate_.rate_hz() : 0; }
    void remark_rate() const;
    void tell_remarks();
    void remark_clocks(result_context& about) const;
    void remark_places(result_context& about) const;
    double seconds(std::int64_t samples) const { return static_cast<double>(samples) / config_.rate_hz; }

    const live_config& config_;
    session_options options_;
    publisher publisher_;
    std::optional<virtual_channels> virtual_;
    std::optional<sample_feed> feed_;
    aligner grid_;
    silence_watch silence_;
    stream_check check_;
    update_maker maker_;
    stream& stream_; ///< of maker_: only before and after the thread
    trigger trigger_;
    hammer hammer_;
    std::vector<device_losses> losses_;
    std::vector<std::optional<bus_health>> health_;
    std::vector<drv_clock_fit_t> clocks_; ///< of the devices that stamp frames themselves
    std::vector<double> busy_s_;          ///< time on the wire of each bus, 0 without a bitrate
    std::int64_t update_samples_, stats_samples_, limit_ = 0, now_ = 0;
    rate_meter rate_;           ///< of the samples that came
    std::int64_t start_ns_ = 0; ///< what t counts from
    std::int64_t gaps_ = 0;
    table_state shown_; ///< hammer test: after the newest hit
    std::int64_t stats_sent_ = 0;
    std::uint64_t updates_made_ = 0, updates_skipped_ = 0, updates_given_up_ = 0;
    relief relief_;
    std::array<bool, relief::steps> overloaded_{}; ///< reported, by step
    bool started_ = false, settled_ = false, alarm_ = false, due_ = false, remarked_ = false;
    update_thread updates_; ///< the last: it ends before what it works on
};

} // namespace okid_host
