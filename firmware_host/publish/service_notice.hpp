// SPDX-License-Identifier: MIT
// What a service manager wants to know (sd_notify): one datagram to $NOTIFY_SOCKET each. Silent without one.
#pragma once
#include "publication.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>

namespace okid_host {

/// Tell the service manager, such as "READY=1".
void notify_service(const std::string& text);

/// STATUS= with every update; WATCHDOG=1 twice in the time the service manager gives, as long as the session lives.
class service_notice : public event_sink {
  public:
    /// Is there a service manager?
    static bool wanted();
    /// @param beats  grows while the session lives
    explicit service_notice(const std::atomic<std::uint64_t>& beats);
    void take(const publication& one) override;
    void tick() override;

  private:
    const std::atomic<std::uint64_t>& beats_;
    std::uint64_t seen_ = 0;
    std::chrono::microseconds half_{0}; ///< 0 = no watchdog
    std::chrono::steady_clock::time_point notified_;
};

} // namespace okid_host
