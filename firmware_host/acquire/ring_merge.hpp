// SPDX-License-Identifier: MIT
// Frames of several rings in the order of their time stamps. A frame waits until every other bus was read as far as its
// stamp (watermark.hpp): a reader that is seconds behind costs time, no sample, and the order does not depend on who ran
// when. Waiting ends where memory or patience does: then frames go on in the order at hand, and are counted.
#pragma once
#include "watermark.hpp"

#include <drv/ring.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace okid_host {

class ring_merge {
  public:
    static constexpr std::int64_t for_ever = std::numeric_limits<std::int64_t>::max();

    /// @param patience_ns  so old a frame may become by the host's clock while it waits for other buses
    explicit ring_merge(std::int64_t patience_ns = for_ever) : patience_ns_(patience_ns) {}
    /// @param most  frames that may wait in the ring for the other buses
    /// @param mark  of the bus, must outlive this; NULL = the merge does not wait for it
    void add(drv_ring_t* ring, std::size_t most, const watermark* mark);
    /// The next frames; those of one ring stay in their order. No heap. @return 0 when no frame may go on now
    std::size_t take(drv_frame_t* frames, std::size_t capacity);
    /// Frames waited at the last take() for a bus that was not read so far yet: look again soon.
    bool waiting() const { return waiting_; }
    std::uint64_t hurried() const { return hurried_; }     ///< frames that went on without waiting to the end
    std::size_t waited_for() const { return waited_for_; } ///< the bus, in the order of add(), that was waited for last

  private:
    struct input {
        drv_ring_t* ring;
        std::size_t most;
        const watermark* mark;
        std::vector<drv_frame_t> batch;
        std::size_t first = 0, end = 0;
        std::int64_t read_ns = std::numeric_limits<std::int64_t>::min(); ///< the mark, as last seen
        bool refill();
        bool empty() const { return first == end; }
        std::int64_t time_ns() const { return batch[first].time_ns; }
    };
    bool may_go(std::int64_t time_ns);
    bool must_go(std::int64_t time_ns) const;

    std::vector<input> inputs_;
    std::int64_t patience_ns_;
    bool waiting_ = false;
    std::uint64_t hurried_ = 0;
    std::size_t waited_for_ = 0;
};

} // namespace okid_host
