// SPDX-License-Identifier: MIT
#include "capture.hpp"

#include "acquire/bus_listener.hpp"
#include "acquire/bus_watch.hpp"
#include "acquire/reader.hpp"
#include "acquire/ring_merge.hpp"
#include "acquire/sender.hpp"
#include "acquire/stop_signal.hpp"
#include "acquire/threads.hpp"
#include "align/grid.hpp"
#include "error.hpp"
#include "gpio_lines.hpp"
#include "recording_link.hpp"

#include <chrono>
#include <fmt/format.h>
#include <memory>

namespace okid_host {
namespace {

using clock_type = std::chrono::steady_clock;

double seconds_since(clock_type::time_point then) {
    return std::chrono::duration<double>(clock_type::now() - then).count();
}

class pump {
  public:
    pump(const live_config& config, stream_target& target, const std::optional<recorder_options>& recording)
        : target_(target), config_(config), lines_(config), frames_(256) {
        for (std::size_t i = 0; i < config.buses.size(); ++i)
            readers_.push_back(
                std::make_unique<bus_reader>(config, i, wake_, *marks_.emplace_back(std::make_unique<watermark>())));
        for (std::size_t i = 0; i < readers_.size(); ++i) {
            watches_.emplace_back(readers_[i]->interface());
            merge_.add(readers_[i]->ring(), bus_reader::most_waiting(), marks_[i].get());
        }
        senders_.resize(readers_.size());
        for (std::size_t i = 0; i < config.buses.size(); ++i)
            if (config.buses[i].sync_hz || !config.buses[i].start_frames.empty())
                senders_[i] = std::make_unique<sync_sender>(config.buses[i]);
        std::optional<recorder_options> recorded = recording;
        for (const auto& mark : marks_)
            if (recorded) recorded->marks.push_back(mark.get());
        recording_.emplace(config, recorded); // a file appears only once there is something to record
        for (std::size_t i = 0; i < config.buses.size() && recording_->get(); ++i)
            readers_[i]->also_into(recording_->get()->ring(i));
        lock_memory(config_.realtime);
    }

    void run(const std::optional<double>& duration_s) {
        for (auto& reader : readers_) reader->start(config_.realtime);
        for (auto& sender : senders_)
            if (sender) sender->start(config_.realtime);
        target_.ready();
        const auto begin = clock_type::now();
        auto heard = begin;
        while (!target_.done() && !stop_requested()) {
            wake_.wait(merge_.waiting() ? 1 : 100, stop_fd(), target_.triggered() ? -1 : lines_.fd());
            target_.alive(true);
            lines_.serve(target_);
            if (move_frames(true)) heard = clock_type::now();
            tell_hurry();
            recording_->serve(target_);
            report_buses();
            look_for_unheard(seconds_since(begin));
            // Stream seconds cannot end on a silent bus: then the clock ends it.
            if (duration_s && seconds_since(heard) > 2 && seconds_since(begin) > *duration_s + 2) break;
        }
        for (auto& sender : senders_)
            if (sender) sender->stop();
        for (auto& reader : readers_) reader->stop();
        while (!target_.done() && move_frames(false)) {
        }
        recording_->finish(target_);
        tell_losses();
        report_buses();
        report_sync();
    }

  private:
    bool move_frames(bool bounded) {
        bool any = false;
        for (std::size_t count; !target_.done() && !(bounded && stop_requested()) &&
                                (count = merge_.take(frames_.data(), frames_.size())) > 0;
             any = true) {
            tell_losses();
            target_.alive(count < frames_.size());
            lines_.serve(target_);
            for (std::size_t i = 0; i < count; ++i) target_.frame(frames_[i]);
        }
        return any;
    }

    void tell_losses() {
        for (std::size_t i = 0; i < readers_.size(); ++i)
            target_.set_losses(i, {readers_[i]->stats().lost_overflow, readers_[i]->ring_overrun()});
    }

    /// A reader is so far behind that the memory for the frames of the others is used up.
    void tell_hurry() {
        if (merge_.hurried() == 0 || merge_.hurried() < 2 * hurried_) return;
        const bool first = hurried_ == 0;
        hurried_ = merge_.hurried();
        const std::size_t bus = merge_.waited_for();
        const std::string text =
            fmt::format("its reader is too far behind: {} frames of other buses waited for it until their memory was "
                        "full and went on without; what of it comes {:g} s later than theirs is only in the journal",
                        hurried_, silence_patience_s);
        target_.bus_event(bus, "behind", text);
        if (first) say("okid: interface {}: {}\n", readers_[bus]->interface(), text);
    }

    void report_buses() {
        for (std::size_t i = 0; i < readers_.size(); ++i) {
            bus_health health{readers_[i]->stats(), std::nullopt};
            if (senders_[i]) health.sync = senders_[i]->report();
            target_.set_health(i, health);
            for (const bus_event& event : watches_[i].look(health.counts)) {
                target_.bus_event(i, event.kind, event.text);
                if (event.urgent) say("okid: interface {}: {}\n", readers_[i]->interface(), event.text);
            }
        }
    }

    /// Two seconds without a frame that is asked for: for one more second all of its bus is heard, then reported.
    void look_for_unheard(double passed_s) {
        for (auto& listener : listeners_) listener->take(target_.check());
        if (listening_ == 0 && passed_s > 2) {
            listening_ = 1;
            if (!target_.heard()) say("okid: waiting for frames on {} ...\n", readers_.front()->interface());
            for (std::size_t i = 0; i < readers_.size(); ++i)
                if (readers_[i]->filtered() && !target_.check().unheard(i).empty())
                    listeners_.push_back(std::make_unique<bus_listener>(config_.buses[i], i));
        } else if (listening_ == 1 && passed_s > 3) {
            listening_ = 2;
            listeners_.clear();
            for (std::size_t i = 0; i < readers_.size(); ++i) tell_unheard(i);
        }
    }

    void tell_unheard(std::size_t bus) {
        const std::string unheard = target_.check().unheard(bus), others = target_.check().others(bus);
        if (config_.buses[bus].serial() || unheard.empty()) return; // a line tells of bytes it cannot read
        if (others.empty() && !target_.heard()) return;             // nothing at all: that is being said
        const std::string text = fmt::format("no frame of {} so far; {}", unheard,
                                             others.empty() ? "is the sensor on?" : "the bus carries " + others);
        target_.bus_event(bus, "unheard", text);
        say("okid: interface {}: {}\n", readers_[bus]->interface(), text);
    }

    void report_sync() const {
        for (std::size_t i = 0; i < senders_.size(); ++i) {
            const sync_report sync = senders_[i] ? senders_[i]->report() : sync_report{};
            if (sync.sent + sync.missed == 0) continue;
            say("okid: interface {}: {} SYNC frames sent, late by {:.0f} us (mean), {:.0f} us (sd), {:.0f} us "
                "(worst); {} left out{}\n",
                readers_[i]->interface(), sync.sent, sync.late_mean_us, sync.late_sd_us, sync.late_worst_us,
                sync.missed, sync.error.empty() ? "" : "; " + sync.error);
        }
    }

    wake_event wake_;
    stream_target& target_;
    const live_config& config_;
    gpio_lines lines_;
    std::vector<std::unique_ptr<watermark>> marks_; ///< of the readers; the recorder looks at them, too
    std::optional<recording_link> recording_;       ///< before the readers, which push into its rings
    std::vector<std::unique_ptr<bus_reader>> readers_;
    ring_merge merge_;
    std::uint64_t hurried_ = 0;
    std::vector<drv_frame_t> frames_;
    std::vector<bus_watch> watches_;
    std::vector<std::unique_ptr<sync_sender>> senders_;
    std::vector<std::unique_ptr<bus_listener>> listeners_;
    int listening_ = 0; ///< 0 not yet, 1 listening, 2 reported
};

} // namespace

void capture(const live_config& config, stream_target& target, const std::optional<double>& duration_s,
             const std::optional<recorder_options>& recording) {
    pump(config, target, recording).run(duration_s);
}

} // namespace okid_host
