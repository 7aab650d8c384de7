// SPDX-License-Identifier: MIT
#include "ring_merge.hpp"

namespace okid_host {
namespace {

constexpr std::size_t at_once = 64; // frames taken out of a ring

} // namespace

void ring_merge::add(drv_ring_t* ring, std::size_t most, const watermark* mark) {
    inputs_.push_back({ring, most, mark, std::vector<drv_frame_t>(at_once)});
    if (!mark) inputs_.back().read_ns = watermark::all_read;
}

/// @return something is there
bool ring_merge::input::refill() {
    if (!empty()) return true;
    first = 0;
    end = drv_ring_pop(ring, batch.data(), batch.size());
    return end > 0;
}

/// A ring is about to overflow, or the frame has waited for long enough.
bool ring_merge::must_go(std::int64_t time_ns) const {
    for (const input& each : inputs_)
        if (drv_ring_used(each.ring) >= each.most) return true;
    return patience_ns_ != for_ever && drv_host_time_ns() - time_ns > patience_ns_;
}

/// Can nothing older come, or is there no time to wait for it? What came meanwhile is in its batch then.
bool ring_merge::may_go(std::int64_t time_ns) {
    waiting_ = false;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        input& each = inputs_[i];
        if (!each.empty() || time_ns <= each.read_ns) continue;
        each.read_ns = each.mark->until();
        if (each.refill() || time_ns <= each.read_ns) continue; // what was pushed before the mark is there now
        waiting_ = true;
        waited_for_ = i;
    }
    if (!waiting_) return true;
    if (!must_go(time_ns)) return false;
    waiting_ = false;
    ++hurried_;
    return true;
}

std::size_t ring_merge::take(drv_frame_t* frames, std::size_t capacity) {
    if (inputs_.size() == 1) return drv_ring_pop(inputs_[0].ring, frames, capacity);
    waiting_ = false;
    for (input& each : inputs_) (void)each.refill();
    std::size_t count = 0;
    const auto oldest = [this]() -> input* {
        input* out = nullptr;
        for (input& each : inputs_)
            if (!each.empty() && (!out || each.time_ns() < out->time_ns())) out = &each;
        return out;
    };
    while (count < capacity) {
        input* next = oldest();
        if (!next || !may_go(next->time_ns())) break;
        next = oldest();
        frames[count++] = next->batch[next->first++];
        (void)next->refill();
    }
    return count;
}

} // namespace okid_host
