// SPDX-License-Identifier: MIT
// How far a bus was read: no frame with an older stamp is still to come. Its reader writes it, the merge asks.
//
// A read that leaves the queue empty has brought all that was stamped before it began. While the reader sleeps for want of
// anything to read, a look at the queue by the asker moves the mark on, so a bus that is silent, down or gone holds
// up no other. A stamp may be older than the read that misses it (a driver that defers, a packet of several samples): by as
// much as was ever seen, at most longest_delay_ns.
#pragma once
#include <drv/host_clock.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <poll.h>

namespace okid_host {

class watermark {
  public:
    static constexpr std::int64_t all_read = std::numeric_limits<std::int64_t>::max();
    static constexpr std::int64_t least_delay_ns = 1000000, longest_delay_ns = 100000000;

    /// The reader, before it reads.
    void at_work() { state_.fetch_or(1); }
    /// A frame came that is as old as that.
    void saw(std::int64_t time_ns) {
        const std::int64_t behind = emptied_ns_ - time_ns;
        if (behind > delay_ns_) delay_ns_ = std::min(behind, longest_delay_ns);
    }
    /// The queue was empty after a read that began then, host time (drv/host_clock.h).
    void emptied(std::int64_t began_ns) {
        emptied_ns_ = began_ns;
        until_ = began_ns - delay_ns_;
    }
    /// It goes to sleep until `fd` can be read; the fd stays open as long as this lives.
    void idle(int fd) {
        fd_ = fd;
        ++state_; // even, and another number than ever before
    }
    /// It has ended: nothing comes any more.
    void ended() { until_ = all_read; }

    /// Any thread. Frames stamped before that are in the ring, all of them.
    std::int64_t until() const {
        const std::uint64_t state = state_;
        const std::int64_t known = until_;
        if (known == all_read || (state & 1)) return known;
        const std::int64_t now = drv_host_time_ns();
        pollfd queue{fd_, POLLIN, 0};
        const bool empty = poll(&queue, 1, 0) == 0;
        return empty && state_ == state ? std::max(known, now - delay_ns_) : known;
    }

  private:
    std::atomic<std::uint64_t> state_{1}; ///< odd = at work
    std::atomic<std::int64_t> until_{std::numeric_limits<std::int64_t>::min()}, delay_ns_{least_delay_ns};
    std::atomic<int> fd_{-1};
    std::int64_t emptied_ns_ = 0; ///< reader only
};

} // namespace okid_host
