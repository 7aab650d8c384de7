// SPDX-License-Identifier: MIT
#include "publisher.hpp"

#include "acquire/host_time.hpp"
#include "alarm_command.hpp"
#include "broker.hpp"
#include "datagrams.hpp"
#include "error.hpp"
#include "influx.hpp"
#include "service_notice.hpp"
#include "subscribers.hpp"

#include <algorithm>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr double redraw_every_s = 0.1; // a replay at full speed updates faster than an eye
constexpr double farewell_s = 1.0;     // for subscribers that still read

bool is_null_device(int fd) {
    struct stat here{};
    struct stat null{};
    return fstat(fd, &here) == 0 && stat("/dev/null", &null) == 0 && S_ISCHR(here.st_mode) &&
           here.st_rdev == null.st_rdev;
}

} // namespace

publisher::publisher(const live_config& config, const publisher_options& options) : options_(options) {
    open_sinks(config);
    if (!options.events.empty())
        events_ = std::make_unique<line_writer>("--events " + options.events, options.events, !options.live);
    if (options.show_table && terminal_table::fits(STDOUT_FILENO))
        terminal_ = std::make_unique<terminal_table>(STDOUT_FILENO);
    else if (options.show_table && !is_null_device(STDOUT_FILENO))
        lines_ = std::make_unique<line_writer>("stdout", "-", !options.live);
    if (sinks_.empty() && !terminal_) return;
    wake_fd_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    thread_ = std::thread([this] { run(); });
}

void publisher::open_sinks(const live_config& config) {
    const publish_config& wanted = config.publish;
    if (!wanted.socket.empty()) sinks_.push_back(std::make_unique<subscribers>(wanted.socket));
    if (wanted.udp) sinks_.push_back(std::make_unique<datagrams>(*wanted.udp));
    if (wanted.prometheus) sinks_.push_back(make_metrics(*wanted.prometheus, [this] { return figures(); }));
    if (wanted.influx) sinks_.push_back(make_influx(config, options_.live));
    if (wanted.mqtt) sinks_.push_back(make_broker(config));
    if (!options_.live) return; // the alarms of a replayed log are in the past: no command is run
    if ((config.alarm.enabled || config.alarm.test_s > 0) && !config.alarm.command.empty())
        sinks_.push_back(std::make_unique<alarm_command>(config.alarm.command));
    if (service_notice::wanted()) sinks_.push_back(std::make_unique<service_notice>(beats_));
}

publisher::~publisher() {
    stop();
    if (wake_fd_ >= 0) close(wake_fd_);
}

publisher_figures publisher::figures() const { return {update_s_, worst_s_, updates_, skipped_, dropped_}; }

void publisher::update_took(double seconds) {
    update_s_ = seconds;
    worst_s_ = std::max<double>(worst_s_, seconds);
    ++updates_;
}

void publisher::wake() const {
    const std::uint64_t one = 1;
    (void)!write(wake_fd_, &one, sizeof one);
}

void publisher::event(nlohmann::ordered_json event, double wall_s) {
    if (!events_ && sinks_.empty() && !options_.listener) return;
    publication one;
    one.wall_s = wall_s;
    one.type = event.value("type", "");
    one.line = std::make_shared<const std::string>(
        event.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
    one.event = std::make_shared<const nlohmann::ordered_json>(std::move(event));
    if (options_.listener) options_.listener(*one.line);
    if (events_) events_->put(one.line);
    if (sinks_.empty()) return;
    if (only_urgent_ && (one.type == "modes" || one.type == "stats"))
        ++dropped_;
    else
        hand_over(std::move(one));
}

void publisher::samples(json_line block) {
    publication one;
    one.line = std::move(block);
    hand_over(std::move(one));
}

void publisher::hand_over(publication one) {
    {
        std::unique_lock<std::mutex> lock(mutex_);
        if (!options_.live) room_.wait(lock, [&] { return waiting_.size() < most_waiting; });
        if (waiting_.size() >= most_waiting) {
            waiting_.pop_front();
            ++dropped_;
        }
        waiting_.push_back(std::move(one));
    }
    wake();
}

void publisher::table(const table_state& state) {
    if (only_urgent_) return;
    if (lines_) try {
            lines_->put(std::make_shared<const std::string>(table_line(state)));
        } catch (const failure&) {
            lines_ = nullptr; // its reader is gone: no reason to end a measurement
        }
    if (!terminal_) return;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        to_draw_ = state;
    }
    wake();
}

void publisher::wait_for_work() {
    std::vector<pollfd> polls{{wake_fd_, POLLIN, 0}};
    for (const auto& each : sinks_) each->add_polls(polls);
    (void)poll(polls.data(), polls.size(), 100);
    std::uint64_t count = 0;
    (void)!read(wake_fd_, &count, sizeof count);
}

void publisher::take_all() {
    std::deque<publication> fresh;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        fresh.swap(waiting_);
    }
    room_.notify_all();
    for (const publication& one : fresh)
        for (const auto& each : sinks_)
            if (one.event)
                each->take(one);
            else
                each->take_samples(one.line);
    for (const auto& each : sinks_) each->tick();
}

void publisher::draw() {
    if (!terminal_ || steady_s() - drawn_at_ < redraw_every_s) return;
    std::optional<table_state> state;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        state.swap(to_draw_);
    }
    if (!state) return;
    drawn_at_ = steady_s();
    if (terminal_->draw(*state)) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!to_draw_) to_draw_ = std::move(state);
}

void publisher::run() {
    const auto ending = [&] {
        const std::lock_guard<std::mutex> lock(mutex_);
        return ending_;
    };
    while (!ending()) {
        wait_for_work();
        take_all();
        draw();
    }
    take_all();
    drawn_at_ = 0;
    draw();
    if (terminal_) terminal_->end();
    for (const double until = steady_s() + farewell_s; steady_s() < until;) {
        bool all = true;
        for (const auto& each : sinks_) all = each->finished() && all;
        if (all) break;
        wait_for_work();
    }
}

void publisher::stop() {
    if (!thread_.joinable()) return;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        ending_ = true;
    }
    wake();
    thread_.join();
}

void publisher::finish() {
    stop();
    sinks_.clear();   // readers see the end now, whatever a terminal still holds up
    lines_ = nullptr; // its last lines are written
    if (events_) events_->finish();
}

} // namespace okid_host
