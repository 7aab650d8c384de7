// SPDX-License-Identifier: MIT
// Frames of several rings in the order of their time stamps, as far as they have come. A reader that was away for seconds
// would else take everything one bus has to say before it hears the next one, and the sample grid, which waits for a
// silent bus no longer than a second, would give up samples that are there.
#pragma once
#include <drv/ring.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace okid_host {

class ring_merge {
  public:
    void add(drv_ring_t* ring);
    /// The next frames; those of one ring stay in their order. No heap. @return 0 when every ring is empty
    std::size_t take(drv_frame_t* frames, std::size_t capacity);

  private:
    struct input {
        drv_ring_t* ring;
        std::vector<drv_frame_t> batch;
        std::size_t first = 0, end = 0;
        bool refill();
        bool empty() const { return first == end; }
        std::int64_t time_ns() const { return batch[first].time_ns; }
    };
    std::vector<input> inputs_;
};

} // namespace okid_host
