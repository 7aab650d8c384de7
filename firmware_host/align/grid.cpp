// SPDX-License-Identifier: MIT
// Places frames on the grid and lets samples out; where a lane stands is decided in grid_lane.cpp.
#include "grid.hpp"

#include "missing.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>

namespace okid_host {
namespace {

std::uint32_t lane_key(std::size_t bus, std::uint32_t id, bool extended) {
    return static_cast<std::uint32_t>(bus) << 30 ^ static_cast<std::uint32_t>(bus >> 2) << 11 ^ id ^
           (extended ? 1u << 29 : 0u);
}

std::size_t hash_of(std::uint32_t key, std::size_t size) { return (key * 2654435761u >> 7) & (size - 1); }

std::int64_t power_of_two(std::int64_t least) {
    std::int64_t value = 1;
    while (value < least) value *= 2;
    return value;
}

constexpr double decision_s = 0.7;          // a late frame waits this long before a loss is believed
constexpr std::int64_t most_late = 400000;  // frames of all lanes that may wait behind a stall
constexpr std::int64_t least_decision = 32; // and for so many periods

} // namespace

const char* gap_cause_name(gap_cause cause) {
    static const char* const names[] = {"socket_overflow", "driver", "sequence", "crc", "link_down", "stall"};
    return names[static_cast<std::size_t>(cause)];
}

grid::grid(const live_config& config, grid_sink& sink)
    : sink_(sink), rate_hz_(config.rate_hz), period_ns_(1e9 / config.rate_hz), channels_(config.channels),
      width_(config.channels.size()), buses_(config.buses.size()), down_(config.buses.size()) {
    build_lanes(config);
    window_ = std::clamp<std::int64_t>(std::llround(rate_hz_ / 4), 4 * reorder_, 4096);
    const double row_bytes = 8.0 * static_cast<double>(width_ + 2) + static_cast<double>(lanes_.size());
    const std::int64_t room = std::llround(most_rows_bytes / row_bytes / 4);
    lag_ = std::clamp<std::int64_t>(std::llround(silence_patience_s * rate_hz_), window_, std::max(room, window_));
    mask_ = power_of_two(2 * lag_) - 1;
    hold_ = std::min(std::max<std::int64_t>(std::llround(decision_s * rate_hz_), least_decision), lag_ / 4);
    most_held_ = static_cast<std::size_t>(
                     hold_ + std::min<std::int64_t>(lag_, most_late / static_cast<std::int64_t>(lanes_.size()))) +
                 64;
    const auto rows = static_cast<std::size_t>(mask_ + 1);
    values_.assign(rows * width_, missing_sample);
    present_.assign(rows * lanes_.size(), 0);
    slots_.assign(rows, 0);
    times_.assign(rows, 0);
    most_before_ = lanes_.size() * static_cast<std::size_t>(64 + std::llround(gather_ns() / period_ns_)) + 256;
    held_.reserve(most_before_);
}

void grid::build_lanes(const live_config& config) {
    for (std::size_t c = 0; c < config.channels.size(); ++c) {
        const channel_config& channel = config.channels[c];
        const std::uint32_t key = lane_key(channel.bus, channel.frame.id, channel.frame.extended != 0);
        lane* found = nullptr;
        for (lane& each : lanes_)
            if (each.bus == channel.bus && each.key == key && each.mask == channel.frame.mask &&
                each.selectors == channel.selectors)
                found = &each;
        if (!found) {
            lane fresh;
            fresh.key = key;
            fresh.mask = channel.frame.mask;
            if (fresh.mask && std::find(masks_.begin(), masks_.end(), fresh.mask) == masks_.end())
                masks_.push_back(fresh.mask);
            fresh.bus = channel.bus;
            fresh.sequence = channel.sequence;
            fresh.selectors = channel.selectors;
            lanes_.push_back(std::move(fresh));
            found = &lanes_.back();
        }
        found->channels.push_back(c);
    }
    for (lane& each : lanes_) {
        each.pages = each.sequence && !each.selectors.empty();
        each.repeated = each.sequence && each.selectors.empty() &&
                        std::any_of(lanes_.begin(), lanes_.end(),
                                    [&](const lane& o) { return !o.selectors.empty() && one_message(o, each); });
    }
    std::sort(masks_.begin(), masks_.end(),
              [](std::uint32_t a, std::uint32_t b) { return std::bitset<32>(a).count() > std::bitset<32>(b).count(); });
    std::size_t most = 0;
    for (const lane& each : lanes_) most = std::max(most, each.channels.size());
    decoded_.resize(most);
    table_.assign(static_cast<std::size_t>(power_of_two(static_cast<std::int64_t>(4 * lanes_.size()))), -1);
    for (std::size_t i = 0; i < lanes_.size(); ++i) {
        std::size_t at = hash_of(lanes_[i].key, table_.size());
        while (table_[at] >= 0 && lanes_[static_cast<std::size_t>(table_[at])].key != lanes_[i].key)
            at = (at + 1) & (table_.size() - 1);
        lanes_[i].next = table_[at];
        table_[at] = static_cast<int>(i);
    }
}

/// A frame belongs to every lane of its identifier whose multiplexors hold. @return there is a lane of that identifier
bool grid::push_to_lanes(const drv_frame_t& frame, std::uint32_t mask) {
    const std::uint32_t id = mask ? frame.id & mask : frame.id;
    const std::uint32_t key = lane_key(frame.bus, id, (frame.flags & DRV_FRAME_EXTENDED) != 0);
    std::size_t at = hash_of(key, table_.size());
    while (table_[at] >= 0 && lanes_[static_cast<std::size_t>(table_[at])].key != key)
        at = (at + 1) & (table_.size() - 1);
    bool known = false, received = false;
    for (int i = table_[at]; i >= 0; i = lanes_[static_cast<std::size_t>(i)].next) {
        lane& each = lanes_[static_cast<std::size_t>(i)];
        if (each.bus != frame.bus || each.mask != mask) continue;
        known = true;
        if (!std::all_of(each.selectors.begin(), each.selectors.end(),
                         [&](const multiplexor& m) { return m.holds(frame); }))
            continue;
        if (!received) ++buses_[frame.bus].received;
        received = true;
        push_to(each, frame);
    }
    return known;
}

bool grid::decode(lane& l, const drv_frame_t& frame) {
    std::int64_t raw{};
    for (std::size_t i = 0; i < l.channels.size(); ++i) {
        const drv_signal_t& layout = channels_[l.channels[i]].layout;
        if (!drv_signal_raw(&layout, frame.data, frame.len, &raw)) return false;
        decoded_[i] = drv_signal_number(&layout, raw);
        if (!std::isfinite(decoded_[i])) return false;
    }
    return !l.sequence || drv_signal_bytes(&*l.sequence) <= frame.len;
}

void grid::push(const drv_frame_t& frame) {
    if (frame.bus >= buses_.size() || (frame.flags & (DRV_FRAME_ERROR | DRV_FRAME_REMOTE))) return;
    if (frame.loss)
        for (lane& each : lanes_)
            if (each.bus == frame.bus) each.loss |= frame.loss;
    settle_overdue(frame.time_ns);
    bool known = push_to_lanes(frame, 0); // an exact identifier comes before one that stands for many (a PGN)
    for (const std::uint32_t mask : masks_)
        if (!known && (frame.flags & DRV_FRAME_EXTENDED)) known = push_to_lanes(frame, mask);
}

void grid::push_to(lane& l, const drv_frame_t& frame) {
    if (!decode(l, frame)) {
        ++buses_[frame.bus].decode_errors;
        return;
    }
    if (!anchored_)
        hold_until_anchored(l, frame);
    else
        place(l, frame);
}

/// Lay rows out in the ring up to and including `upto`; makes room by letting the oldest go.
void grid::open_rows(std::int64_t upto) {
    if (upto - next_ > mask_) {
        while (next_ < opened_ && upto - next_ > mask_) emit_front();
        if (next_ == opened_ && upto - next_ > window_) skip_to(upto - window_ / 2);
    }
    for (; opened_ <= upto; ++opened_) {
        std::fill_n(row(opened_), width_, missing_sample);
        std::fill_n(present(opened_), lanes_.size(), std::uint8_t{0});
        slot(opened_) = 0;
        times_[static_cast<std::size_t>(opened_ & mask_)] = 0;
    }
}

/// The frame's numbers (in decoded_) into their row.
void grid::insert(lane& l, std::int64_t index, const drv_frame_t& frame) {
    grid_bus_counts& counts = buses_[frame.bus];
    const auto which = static_cast<std::size_t>(&l - lanes_.data());
    const bool late = index < l.last;
    l.last = std::max(l.last, index);
    l.recent[l.recent_at++ % l.recent.size()] = index;
    if (l.recent_at >= l.recent.size()) l.passed = *std::min_element(l.recent.begin(), l.recent.end());
    l.gone = false;
    if (index < next_) {
        if (index < 0) return; // before the grid begins
        const bool remembered = opened_ - index <= mask_;
        const bool twice = remembered && present(index)[which];
        counts.duplicate += twice && !l.repeated;
        counts.out_of_order += !twice;
        counts.too_late += !twice;
        return;
    }
    open_rows(index);
    if (present(index)[which]) {
        counts.duplicate += !l.repeated;
        return;
    }
    if (late) ++counts.out_of_order;
    present(index)[which] = 1;
    std::int64_t& time = times_[static_cast<std::size_t>(index & mask_)];
    time = slot(index) == 0 ? frame.time_ns : std::min(time, frame.time_ns);
    ++slot(index);
    double* to = row(index);
    for (std::size_t i = 0; i < l.channels.size(); ++i) to[l.channels[i]] = decoded_[i];
    drain(false);
}

/// May the lane still bring the sample that goes out next? One that is silent has `lag` samples for it unless it is gone,
/// one that jumped over it until its newest frames all lie beyond: during an outage they may be few.
bool grid::may_come(const lane& l) const {
    const std::int64_t ahead = opened_ - next_;
    if (!l.heard || l.last < next_) return !l.gone && ahead <= lag_;
    return l.passed <= next_ && ahead <= mask_;
}

void grid::drain(bool all) {
    const auto lanes = static_cast<std::int64_t>(lanes_.size());
    while (next_ < opened_ && next_ < limit_) {
        if (slot(next_) < lanes && !all) {
            if (opened_ - next_ <= 1) return;
            const std::uint8_t* have = present(next_);
            for (std::size_t i = 0; i < lanes_.size(); ++i)
                if (!have[i] && may_come(lanes_[i])) return;
            leave_behind();
        }
        emit_front();
    }
}

/// Lanes that lack the sample at the front and were waited for in vain.
void grid::leave_behind() {
    if (opened_ - next_ <= lag_) return;
    const std::uint8_t* have = present(next_);
    for (std::size_t i = 0; i < lanes_.size(); ++i)
        if (!have[i] && (!lanes_[i].heard || lanes_[i].last < next_) && lanes_[i].late.empty()) lanes_[i].gone = true;
}

void grid::emit_front() {
    const std::uint8_t* have = present(next_);
    for (std::size_t i = 0; i < lanes_.size(); ++i) {
        lane& l = lanes_[i];
        if (have[i]) {
            if (l.gap_count) close_gap(l, true);
            ++l.expected;
            ++l.received;
        } else {
            extend_gap(l, next_, 1);
            l.gap_alone += slot(next_) > 0;
        }
    }
    const std::int64_t index = next_++;
    sink_.on_sample(index, row(index));
}

/// Nothing at all arrived between next_ and index.
void grid::skip_to(std::int64_t index) {
    const std::int64_t count = index - next_;
    if (count <= 0) return;
    for (lane& l : lanes_) extend_gap(l, next_, count);
    const std::int64_t first = next_;
    next_ = opened_ = index;
    for (std::int64_t i = std::max(first, index - mask_); i < index; ++i)
        std::fill_n(present(i), lanes_.size(), std::uint8_t{0});
    sink_.on_missing(first, count);
}

void grid::extend_gap(lane& l, std::int64_t first, std::int64_t count) {
    if (l.gap_count == 0) l.gap_first = first;
    l.gap_count += count;
    l.expected += count;
}

/// Of a gap that has not ended.
gap_cause grid::silent_cause(const lane& l) const {
    return down_[l.bus] || (l.loss & DRV_LOSS_LINK) ? gap_cause::link_down : gap_cause::stall;
}

/// The cause is what was known when the lane jumped over the gap, or that it was silent while others were not.
void grid::close_gap(lane& l, bool resumed) {
    grid_gap gap;
    gap.first = l.gap_first;
    gap.count = l.gap_count;
    gap.last = gap.first + gap.count - 1;
    gap.cause = gap_cause::sequence;
    for (const cause_mark& mark : l.marks)
        if (mark.first <= gap.last && mark.last >= gap.first) {
            gap.cause = mark.cause;
            gap.within = mark.within;
        }
    if (gap.cause == gap_cause::sequence && (stalled(l) || (!resumed && gap.count > reorder_)))
        gap.cause = gap_cause::stall;
    if (!resumed && silent_cause(l) == gap_cause::link_down) gap.cause = gap_cause::link_down;
    buses_[l.bus].lost[static_cast<std::size_t>(gap.cause)] += static_cast<std::uint64_t>(gap.count);
    l.gap_count = l.gap_alone = 0;
    for (const std::size_t channel : l.channels) {
        gap.channel = channel;
        sink_.on_gap(gap);
    }
}

void grid::finish() {
    if (!anchored_ && heard_ > 0) anchor();
    for (lane& l : lanes_) {
        if (!l.heard && !l.late.empty()) end_joining(l);
        settle(l, 0, true);
        end_suspicion(l);
    }
    const auto lanes = static_cast<std::int64_t>(lanes_.size());
    if (opened_ > next_ && slot(opened_ - 1) < lanes) --opened_;
    drain(true);
    for (lane& l : lanes_)
        if (l.gap_count) close_gap(l, false);
}

/// A silence that lasts counts as lost by now.
grid_bus_counts grid::bus(std::size_t index) const {
    grid_bus_counts out = buses_[index];
    for (const lane& l : lanes_)
        if (l.bus == index && stalled(l))
            out.lost[static_cast<std::size_t>(silent_cause(l))] += static_cast<std::uint64_t>(l.gap_count);
    return out;
}

grid_channel_counts grid::channel(std::size_t index) const {
    for (const lane& l : lanes_)
        if (std::find(l.channels.begin(), l.channels.end(), index) != l.channels.end())
            return {l.expected, l.received, l.uncertain, place_std_s(l)};
    return {};
}

std::vector<std::size_t> grid::silent_channels() const {
    std::vector<std::size_t> out;
    for (const lane& l : lanes_)
        if (!l.heard) out.insert(out.end(), l.channels.begin(), l.channels.end());
    return out;
}

} // namespace okid_host
