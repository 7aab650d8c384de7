// SPDX-License-Identifier: MIT
#include "sender.hpp"

#include "error.hpp"
#include "reader.hpp"
#include "threads.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr int start_patience_ms = 1000;
constexpr std::int64_t second_ns = 1000000000;

int is_stopping(void* flag) { return static_cast<const std::atomic<bool>*>(flag)->load(std::memory_order_relaxed); }

} // namespace

sync_sender::sync_sender(const bus_config& bus) : bus_(bus) {
    const int code = drv_sink_open(&sink_, interface_of(bus).c_str());
    if (code != 0) throw_bus_failure(-code, bus, sink_.error);
}

sync_sender::~sync_sender() {
    stop();
    drv_sink_close(&sink_);
}

void sync_sender::start(const realtime_config& realtime) {
    for (const drv_frame_t& frame : bus_.start_frames)
        if (!send(frame, start_patience_ms))
            throw failure(exit_device,
                          fmt::format("interface {}: start frame {:#x}: {}", bus_.interface, frame.id, report_.error));
    if (!bus_.sync_hz) return;
    thread_ = quiet_thread([this] { run(); });
    put_first(thread_, realtime);
}

void sync_sender::stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
}

sync_report sync_sender::report() const {
    const std::lock_guard<std::mutex> hold(mutex_);
    return report_;
}

/// One frame; an interface that was made again is opened again.
bool sync_sender::send(const drv_frame_t& frame, int patience_ms) {
    int code = sink_.fd < 0 ? -ENXIO : drv_sink_write(&sink_, &frame, patience_ms);
    if (code == -ENXIO || code == -ENODEV) {
        drv_sink_close(&sink_);
        code = drv_sink_open(&sink_, interface_of(bus_).c_str());
        if (code == 0) code = drv_sink_write(&sink_, &frame, patience_ms);
    }
    if (code == 0) return true;
    const std::lock_guard<std::mutex> hold(mutex_);
    report_.error = sink_.error;
    return false;
}

/// Deadline n is n / sync_hz behind the first: late ones are sent at once, those a whole period late are left out.
void sync_sender::run() {
    const double period_ns = 1e9 / *bus_.sync_hz;
    drv_pacer_t pacer;
    drv_pacer_start(&pacer, second_ns / 100);
    std::int64_t next = 0;
    while (drv_pacer_wait(&pacer, std::llround(static_cast<double>(next) * period_ns), is_stopping, &stopping_)) {
        const bool sent = send(bus_.sync_frame, 0);
        const auto due = static_cast<std::int64_t>(std::floor(static_cast<double>(drv_pacer_now(&pacer)) / period_ns));
        const std::int64_t left_out = std::max<std::int64_t>(0, due - next - 1);
        next += 1 + left_out;
        const std::lock_guard<std::mutex> hold(mutex_);
        report_.sent += sent;
        report_.missed += static_cast<std::uint64_t>(left_out) + !sent;
        report_.late_mean_us = pacer.mean_ns / 1e3;
        report_.late_sd_us = drv_pacer_deviation(&pacer) / 1e3;
        report_.late_worst_us = static_cast<double>(pacer.worst_ns) / 1e3;
    }
}

} // namespace okid_host
