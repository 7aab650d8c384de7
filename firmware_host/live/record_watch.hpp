// SPDX-License-Identifier: MIT
// What frames go to when they are only recorded: counts what is complete and waits for the trigger, identifies nothing.
#pragma once
#include "align/aligner.hpp"
#include "align/trigger.hpp"
#include "config/config.hpp"
#include "files/progress.hpp"
#include "stream_target.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

class record_watch : public stream_target, private grid_sink {
  public:
    record_watch(const live_config& config, const std::optional<double>& duration_s);

    void frame(const drv_frame_t& frame) override;
    void set_losses(std::size_t bus, const device_losses& losses) override { losses_[bus] = losses; }
    void set_health(std::size_t, const bus_health&) override {}
    void bus_event(std::size_t, const char*, const std::string&) override {} // urgent ones stand on stderr
    void record_event(const std::string& kind, const std::string& text) override;
    void trigger_edge(std::int64_t time_ns) override;
    bool triggered() const override { return !trigger_.waiting(); }
    std::int64_t trigger_ns() const override { return trigger_.time_ns(); }
    lamp_state lamps() const override;
    bool done() const override;
    bool heard() const override { return first_ns_ != 0; }
    stream_check& check() override { return check_; }
    /// What was recorded, in words. Throws `failure`: exit 3 when nothing was, exit 4 when the disk ended it.
    void finish() override;

  private:
    void on_sample(std::int64_t index, const double* row) override;
    void on_missing(std::int64_t index, std::int64_t count) override;
    void on_gap(const grid_gap&) override {}
    void show();

    const live_config& config_;
    std::optional<double> duration_s_;
    aligner grid_;
    stream_check check_;
    trigger trigger_;
    std::vector<device_losses> losses_;
    std::int64_t limit_ = 0, first_ns_ = 0, last_ns_ = 0;
    std::uint64_t frames_ = 0;
    bool stopped_ = false;
    double shown_at_ = 0;
    std::optional<progress> progress_; ///< none off a terminal of what has no end: a service
};

} // namespace okid_host
