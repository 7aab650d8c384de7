// SPDX-License-Identifier: MIT
#include "reader.hpp"

#include "error.hpp"
#include "files/nearest_name.hpp"

#include "serial_line.hpp"
#include "threads.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <net/if_arp.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <utility>

namespace okid_host {
namespace {

constexpr std::size_t ring_frames = 1 << 17; // 6 s of a saturated FD bus, 15 s of a classic one
constexpr int look_ms = 100;                 // how often a vanished interface is looked for
constexpr auto busy = std::chrono::milliseconds(2), rest = std::chrono::milliseconds(1);
constexpr auto publish_every = std::chrono::milliseconds(20);
constexpr int batches_between_looks = 64;

/// Another number whenever something happened to the bus that is to be reported at once.
std::uint64_t happenings(const drv_stats_t& counts) {
    return 2 * (counts.bus_off + counts.restarts + counts.error_passive + counts.link_down + counts.reopened) +
           static_cast<std::uint64_t>(counts.link_is_down);
}

/// What messages call it.
std::string name_in_messages(const bus_config& bus) {
    if (bus.on_line()) return bus.device;
    return bus.adapter.empty() ? bus.interface : bus.adapter;
}

} // namespace

std::size_t bus_reader::most_waiting() { return ring_frames / 4 * 3; }

bus_reader::bus_reader(const live_config& config_of_all, std::size_t bus, wake_event& wake, watermark& mark)
    : interface_(name_in_messages(config_of_all.buses[bus])), bus_(static_cast<std::uint8_t>(bus)), wake_(wake),
      stop_fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)), mark_(mark),
      block_(new std::byte[drv_ring_memsize(ring_frames)]()), batch_(64) {
    ring_ = drv_ring_create(ring_frames, block_.get(), drv_ring_memsize(ring_frames));
    const bus_config& mine = config_of_all.buses[bus];
    const std::vector<drv_filter_t> frames = wanted_frames(config_of_all, bus);
    source_.ops = mine.serial() ? &drv_source_serial : mine.on_line() ? &drv_source_slcan : &drv_source_socketcan;
    drv_source_config_t config{};
    name_interface(mine, config);
    if (mine.on_line()) config.line = line_settings(mine, config_of_all.rate_hz);
    // The load of a bus is that of all its frames: then nothing is left out by the kernel.
    if (frames.size() <= DRV_MAX_FILTERS && !mine.bitrate) {
        config.filters = frames.data();
        config.filter_count = static_cast<std::int32_t>(frames.size());
        filtered_ = !mine.on_line();
    }
    const int code = source_.ops->open(&source_, &config);
    if (code != 0) {
        close(stop_fd_);
        if (mine.on_line()) throw_line_failure(-code, interface_, source_.error);
        throw_bus_failure(-code, mine, source_.error);
    }
    queue_fd_ = epoll_create1(EPOLL_CLOEXEC);
    publish_stats();
}

bus_reader::~bus_reader() {
    stop();
    source_.ops->close(&source_);
    close(queue_fd_);
    close(stop_fd_);
}

void bus_reader::start(const realtime_config& realtime) {
    thread_ = quiet_thread([this] { run(); });
    put_first(thread_, realtime);
}

void bus_reader::stop() {
    if (!thread_.joinable()) return;
    stopping_ = true;
    const std::uint64_t one = 1;
    (void)!write(stop_fd_, &one, sizeof one);
    thread_.join();
    mark_.ended();
}

/// One read of the source. @return frames moved, negative when it failed
int bus_reader::drain_once() {
    const int count = source_.ops->read(&source_, batch_.data(), static_cast<int>(batch_.size()));
    if (count <= 0) return count;
    for (int i = 0; i < count; ++i) batch_[static_cast<std::size_t>(i)].bus = bus_;
    mark_.saw(batch_.front().time_ns);
    drv_ring_push(ring_, batch_.data(), static_cast<std::size_t>(count));
    if (second_ring_) drv_ring_push(second_ring_, batch_.data(), static_cast<std::size_t>(count));
    wake_.signal();
    return count;
}

void bus_reader::publish_stats() {
    drv_stats_t now{};
    source_.ops->stats(&source_, &now);
    const std::lock_guard<std::mutex> hold(mutex_);
    seen_ = now;
}

drv_stats_t bus_reader::stats() const {
    const std::lock_guard<std::mutex> hold(mutex_);
    return seen_;
}

/// Until the queue is empty, or often enough for now. @return frames moved, negative when the source failed
int bus_reader::drain() {
    int total = 0;
    for (int i = 0; i < batches_between_looks && !stopping_; ++i) {
        const std::int64_t began_ns = drv_host_time_ns();
        const int moved = drain_once();
        total += std::max(moved, 0);
        if (moved > 0) continue;
        mark_.emptied(began_ns);
        return moved < 0 ? moved : total;
    }
    return total;
}

/// Until something can be read, the end is wanted, or look_ms have passed: a source that fails has only the time.
void bus_reader::wait(bool failed) {
    epoll_event readable{};
    readable.events = EPOLLIN;
    const int fd = source_.ops->fd(&source_); // a line that was plugged in again has a new one
    if (fd >= 0) (void)epoll_ctl(queue_fd_, EPOLL_CTL_ADD, fd, &readable);
    pollfd waits[2] = {{stop_fd_, POLLIN, 0}, {queue_fd_, POLLIN, 0}};
    mark_.idle(queue_fd_);
    (void)poll(waits, failed ? 1 : 2, look_ms);
    mark_.at_work();
}

void bus_reader::run() {
    using clock = std::chrono::steady_clock;
    // The kernel stamps CAN frames: on a busy bus many are taken at once instead of one at a time. A line is stamped here.
    const bool may_rest = source_.ops == &drv_source_socketcan;
    int moved = 0;
    std::uint64_t happened = 0;
    auto published = clock::now(), before = published;
    while (!stopping_) {
        wait(moved < 0);
        moved = drain();
        const auto now = clock::now();
        const std::uint64_t before_it = std::exchange(happened, happenings(source_.counts));
        if (happened != before_it || now - published >= publish_every) {
            published = now;
            publish_stats();
            if (happened != before_it) wake_.signal();
        }
        if (may_rest && moved > 0 && now - before < busy) std::this_thread::sleep_for(rest);
        before = now;
    }
    for (int i = 0; i < 1 << 14 && drain_once() > 0; ++i) {
    } // what had arrived before the end
    publish_stats();
}

std::vector<std::string> can_interfaces() {
    std::vector<std::string> out;
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/sys/class/net", ignored)) {
        int type = 0;
        std::ifstream(entry.path() / "type") >> type;
        if (type == ARPHRD_CAN) out.push_back(entry.path().filename().string());
    }
    std::sort(out.begin(), out.end());
    return out;
}

std::string interface_of(const bus_config& bus) {
    char name[DRV_NAME_BYTES] = "";
    if (bus.adapter.empty()) return bus.interface;
    (void)drv_link_find("/sys", bus.adapter.c_str(), bus.adapter_channel, name);
    return name;
}

void name_interface(const bus_config& bus, drv_source_config_t& config) {
    config.interfaces[0] = bus.interface.c_str();
    config.interface_count = 1;
    config.adapter = bus.adapter.empty() ? nullptr : bus.adapter.c_str();
    config.adapter_channel = bus.adapter_channel;
}

std::vector<std::string> usb_adapters() {
    std::vector<std::string> out;
    for (const std::string& name : can_interfaces()) {
        drv_usb_t usb{};
        if (drv_link_usb("/sys", name.c_str(), &usb) != 0) continue;
        const std::string serial = usb.serial[0] ? printable(usb.serial, 40) : "no serial number";
        out.push_back(fmt::format("{} ({}, port {})", name, serial, usb.port));
    }
    return out;
}

void throw_bus_failure(int code, const bus_config& bus, const std::string& reason) {
    if (bus.adapter.empty() || (code != ENODEV && code != ENOTUNIQ))
        throw_interface_failure(code, interface_of(bus), reason);
    const std::vector<std::string> there = usb_adapters();
    throw failure(exit_device, fmt::format("{}; USB adapters with CAN: {}", printable(reason, 300),
                                           there.empty() ? "none" : list_names(there)));
}

void throw_interface_failure(int code, const std::string& interface, const std::string& reason) {
    const std::string text = printable(reason, 300);
    if (code == EAFNOSUPPORT)
        throw failure(exit_device, text +
                                       ". Load the modules: sudo modprobe -a can can-raw vcan; without them use `okid "
                                       "replay LOG -c CONFIG.toml`");
    if (code == ENETDOWN)
        throw failure(
            exit_device,
            fmt::format("{}. Bring it up: sudo ip link set {} up (a real bus also needs type can bitrate 1000000)",
                        text, interface));
    if (code == EPERM || code == EACCES) throw failure(exit_device, text + ". Run it with sudo, or with CAP_NET_RAW");
    const std::vector<std::string> there = can_interfaces();
    const std::string found = there.empty()
                                  ? "this machine has no CAN interface"
                                  : "CAN interfaces found: " + list_names(there) + did_you_mean(interface, there);
    throw failure(exit_device, fmt::format("{}; {}. Plug the adapter in, or make a virtual one: sudo ip link add {} "
                                           "type vcan && sudo ip link set {} up",
                                           text, found, interface, interface));
}

} // namespace okid_host
