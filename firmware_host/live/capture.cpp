// SPDX-License-Identifier: MIT
#include "capture.hpp"

#include "reader.hpp"
#include "stop_signal.hpp"

#include <chrono>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace okid_host {
namespace {

using clock_type = std::chrono::steady_clock;

double seconds_since(clock_type::time_point then) {
    return std::chrono::duration<double>(clock_type::now() - then).count();
}

/// Owns the eventfd the readers write to.
struct wake_event {
    int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    ~wake_event() { close(fd); }
    void wait(int timeout_ms) const {
        pollfd waits[2] = {{fd, POLLIN, 0}, {stop_fd(), POLLIN, 0}};
        (void)poll(waits, 2, timeout_ms);
        std::uint64_t count = 0;
        (void)!read(fd, &count, sizeof count);
    }
};

class pump {
  public:
    pump(const live_config& config, session& target) : session_(target), frames_(256) {
        for (std::size_t i = 0; i < config.buses.size(); ++i)
            readers_.push_back(
                std::make_unique<bus_reader>(config.buses[i].interface, i, wanted_frames(config, i), wake_.fd));
        down_.assign(readers_.size(), 0);
    }

    void run(const std::optional<double>& duration_s) {
        for (auto& reader : readers_) reader->start();
        const auto begin = clock_type::now();
        auto heard = begin;
        bool hinted = false;
        while (!session_.done() && !stop_requested()) {
            wake_.wait(100);
            if (move_frames(true)) heard = clock_type::now();
            report_links();
            if (!session_.heard() && !hinted && seconds_since(begin) > 2) {
                hinted = true;
                std::fprintf(stderr, "okid: waiting for frames on %s ...\n", readers_.front()->interface().c_str());
            }
            // Stream seconds cannot end on a silent bus: then the clock ends it.
            if (duration_s && seconds_since(heard) > 2 && seconds_since(begin) > *duration_s + 2) break;
        }
        for (auto& reader : readers_) reader->stop();
        while (!session_.done() && move_frames(false)) {
        }
        tell_losses();
    }

  private:
    bool move_frames(bool bounded) {
        bool any = false;
        for (auto& reader : readers_)
            for (std::size_t count; !session_.done() && !(bounded && stop_requested()) &&
                                    (count = reader->take(frames_.data(), frames_.size())) > 0;
                 any = true) {
                tell_losses();
                for (std::size_t i = 0; i < count; ++i) session_.frame(frames_[i]);
            }
        return any;
    }

    void tell_losses() {
        for (std::size_t i = 0; i < readers_.size(); ++i)
            session_.set_losses(i, {readers_[i]->stats().lost_overflow, readers_[i]->ring_overrun()});
    }

    void report_links() {
        for (std::size_t i = 0; i < readers_.size(); ++i) {
            const drv_stats_t stats = readers_[i]->stats();
            if (stats.link_down == down_[i]) continue;
            down_[i] = stats.link_down;
            std::fprintf(stderr, "okid: interface %s went down or away; waiting for it\n",
                         readers_[i]->interface().c_str());
        }
    }

    wake_event wake_;
    session& session_;
    std::vector<std::unique_ptr<bus_reader>> readers_;
    std::vector<drv_frame_t> frames_;
    std::vector<std::uint64_t> down_;
};

} // namespace

void capture(const live_config& config, const session_options& options) {
    catch_stop_signals();
    session live(config, options);
    {
        pump from_buses(config, live);
        from_buses.run(options.duration_s);
    }
    live.finish();
}

} // namespace okid_host
