// SPDX-License-Identifier: MIT
#include "ring_merge.hpp"

namespace okid_host {
namespace {

constexpr std::size_t at_once = 64; // frames taken out of a ring

} // namespace

void ring_merge::add(drv_ring_t* ring) { inputs_.push_back({ring, std::vector<drv_frame_t>(at_once)}); }

/// @return something is there
bool ring_merge::input::refill() {
    if (!empty()) return true;
    first = 0;
    end = drv_ring_pop(ring, batch.data(), batch.size());
    return end > 0;
}

std::size_t ring_merge::take(drv_frame_t* frames, std::size_t capacity) {
    if (inputs_.size() == 1) return drv_ring_pop(inputs_[0].ring, frames, capacity);
    for (input& each : inputs_) (void)each.refill();
    std::size_t count = 0;
    while (count < capacity) {
        input* next = nullptr;
        for (input& each : inputs_)
            if (!each.empty() && (!next || each.time_ns() < next->time_ns())) next = &each;
        if (!next) break;
        frames[count++] = next->batch[next->first++];
        // One that has nothing more may get a frame with an older stamp than the others have: look before going on.
        if (next->empty() && !next->refill()) break;
    }
    return count;
}

} // namespace okid_host
