// SPDX-License-Identifier: MIT
#include "rig_play.hpp"

#include "acquire/serial_line.hpp"
#include "acquire/stop_signal.hpp"
#include "error.hpp"
#include "rig_frames.hpp"
#include "rig_line.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <drv/serial_port.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace okid_host {
namespace {

class can_sender {
  public:
    explicit can_sender(const std::string& interface) : interface_(interface) {
        try {
            open_socket();
        } catch (...) {
            if (fd_ >= 0) close(fd_);
            throw;
        }
    }
    ~can_sender() { close(fd_); }
    can_sender(const can_sender&) = delete;
    can_sender& operator=(const can_sender&) = delete;

    /// A full queue is waited for, a downed link is an error.
    void send(const drv_frame_t& source) const {
        can_frame frame{};
        frame.can_id = source.id;
        frame.can_dlc = source.len;
        std::memcpy(frame.data, source.data, source.len);
        while (write(fd_, &frame, sizeof frame) != sizeof frame) {
            if (errno == ENOBUFS || errno == EAGAIN) {
                pollfd writable{fd_, POLLOUT, 0};
                poll(&writable, 1, 1);
            } else if (errno != EINTR) {
                stop(errno == ENETDOWN ? "the interface is down; `ip link set up` brings it up" : std::strerror(errno));
            }
        }
    }

  private:
    void open_socket() {
        fd_ = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
        if (fd_ < 0)
            stop(errno == EAFNOSUPPORT
                     ? "this kernel has no CAN (AF_CAN); load the modules: sudo modprobe -a can can-raw vcan"
                     : std::strerror(errno));
        const can_filter none{};
        setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, &none, 0); // sends only
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(if_nametoindex(interface_.c_str()));
        if (address.can_ifindex == 0) stop("no such interface; `ip link add dev vcan0 type vcan` makes a virtual one");
        if (bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) stop(std::strerror(errno));
    }
    [[noreturn]] void stop(const char* reason) const {
        throw failure(exit_device, fmt::format("{}: frames cannot be sent: {}", interface_, reason));
    }

    std::string interface_;
    int fd_ = -1;
};

class line_sender {
  public:
    line_sender(const std::string& device, int baud) : device_(device) {
        const int code = drv_serial_open(&port_, device.c_str(), baud);
        if (code != 0) throw_line_failure(-code, device, port_.error);
    }
    ~line_sender() { drv_serial_close(&port_); }
    line_sender(const line_sender&) = delete;
    line_sender& operator=(const line_sender&) = delete;

    void send(const std::vector<std::uint8_t>& bytes) {
        constexpr int patience_ms = 5000;
        if (drv_serial_write(&port_, bytes.data(), bytes.size(), patience_ms) != 0)
            throw failure(exit_device, fmt::format("{}: {}", device_, port_.error));
    }

  private:
    std::string device_;
    drv_serial_t port_{};
};

void sleep_until(timespec moment) {
    while (!stop_requested() && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &moment, nullptr) == EINTR) {
    }
}

timespec later(timespec start, double seconds) {
    const auto ns = static_cast<long long>(start.tv_nsec) + std::llround(seconds * 1e9);
    start.tv_sec += ns / 1'000'000'000;
    start.tv_nsec = ns % 1'000'000'000;
    return start;
}

} // namespace

void play_rig(const rig_run& run, const std::string& target, int baud) {
    catch_stop_signals();
    timespec start{};
    clock_gettime(CLOCK_MONOTONIC, &start);
    if (is_device(target)) {
        line_sender line(target, baud);
        const std::size_t most = rig_packet_samples(run);
        for (std::size_t n = 0; n < run.count && !stop_requested(); n += most) {
            const std::size_t count = std::min(most, run.count - n);
            sleep_until(later(start, static_cast<double>(n + count - 1) / run.rate_hz)); // the last sample is there
            line.send(rig_packet(run, n, count));
        }
        return;
    }
    const can_sender sender(target);
    const auto messages = rig_messages(run);
    for (std::size_t n = 0; n < run.count && !stop_requested(); ++n) {
        sleep_until(
            later(start, static_cast<double>(n) / run.rate_hz)); // the bus itself spaces the frames of one sample
        for (const rig_message& message : messages) sender.send(rig_frame(run, message, n, 0));
    }
}

} // namespace okid_host
