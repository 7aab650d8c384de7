// SPDX-License-Identifier: MIT
// One thread a bus that does nothing but empty the socket into a ring, so that no identification can make it overflow.
#pragma once
#include "config/config.hpp"
#include "wake_event.hpp"
#include "watermark.hpp"

#include <drv/ring.h>
#include <drv/source.h>

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace okid_host {

class bus_reader {
  public:
    /// Opens the interface or the serial line. Throws `failure` (exit 4) that says what is there and what to do.
    /// @param bus  number given to every frame; @param wake  signalled when frames wait
    /// @param mark  how far the bus was read, for the merge; ended when the thread has
    bus_reader(const live_config& config, std::size_t bus, wake_event& wake, watermark& mark);
    ~bus_reader();
    bus_reader(const bus_reader&) = delete;
    bus_reader& operator=(const bus_reader&) = delete;

    /// The recorder gets every frame, too.
    void also_into(drv_ring_t* ring) { second_ring_ = ring; }
    void start(const realtime_config& realtime);
    /// End the thread; frames still in the socket and in the ring can be taken afterwards.
    void stop();
    drv_ring_t* ring() { return ring_; }
    static std::size_t most_waiting(); ///< frames in the ring that may wait for other buses

    /// Counts of the source and of the ring, as of the last time the thread looked (at most 0.1 s ago).
    drv_stats_t stats() const;
    std::uint64_t ring_overrun() const { return drv_ring_overrun(ring_); }
    const std::string& interface() const { return interface_; } ///< or the adapter, or the device of a line
    bool filtered() const { return filtered_; } ///< the kernel lets nothing pass that no channel asks for

  private:
    void run();
    int drain_once();
    int drain();
    void wait(bool failed);
    void publish_stats();

    std::string interface_;
    std::uint8_t bus_;
    bool filtered_ = false;
    wake_event& wake_;
    int stop_fd_, queue_fd_ = -1; ///< queue_fd_: an epoll set of what the source reads, open as long as this lives
    watermark& mark_;
    drv_source_t source_{};
    std::unique_ptr<std::byte[]> block_;
    drv_ring_t *ring_ = nullptr, *second_ring_ = nullptr;
    std::vector<drv_frame_t> batch_;
    std::thread thread_;
    std::atomic<bool> stopping_{false};
    mutable std::mutex mutex_;
    drv_stats_t seen_{};
};

/// The interface that a socketcan bus has now, "" = its adapter is not there.
std::string interface_of(const bus_config& bus);

/// Which interface a source is to open. `bus` outlives the opening.
void name_interface(const bus_config& bus, drv_source_config_t& config);

/// The same as throw_interface_failure, of a bus that may be an adapter.
[[noreturn]] void throw_bus_failure(int code, const bus_config& bus, const std::string& reason);

/// The text and exit code for an interface that cannot be opened: what was found on this machine and what to do.
[[noreturn]] void throw_interface_failure(int code, const std::string& interface, const std::string& reason);

/// CAN interfaces of USB adapters with serial number and port, for messages.
std::vector<std::string> usb_adapters();

/// Names of the CAN interfaces of this machine.
std::vector<std::string> can_interfaces();

} // namespace okid_host
