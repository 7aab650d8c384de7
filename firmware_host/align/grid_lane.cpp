// SPDX-License-Identifier: MIT
// Where a lane stands on the grid once it has begun: counters unwrapped, jumps believed or not.
#include "grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace okid_host {
namespace {

constexpr double longest_pause_s = 5; // beyond it the clock says how often a counter went round

} // namespace

bool grid::read_counter(const lane& l, const drv_frame_t& frame, std::uint64_t& counter) const {
    std::int64_t raw{};
    if (!l.sequence || !drv_signal_raw(&*l.sequence, frame.data, frame.len, &raw)) return false;
    counter = static_cast<std::uint64_t>(raw);
    return true;
}

void grid::place(lane& l, const drv_frame_t& frame) {
    std::uint64_t counter{};
    if (!l.heard) {
        join(l, frame);
        return;
    }
    if (read_counter(l, frame, counter)) {
        place_by_counter(l, frame, counter);
        return;
    }
    place_by_cadence(l, frame);
}

/// The lane's newest frame is now at `index`; what it jumped over is lost unless it still comes.
void grid::move_on(lane& l, const drv_frame_t& frame, std::int64_t index, bool pause, std::int64_t within) {
    if (index > l.last + 1) note_loss(l, l.last + 1, index - 1, pause, within);
    l.loss = 0;
    if (l.sequence) follow_counted(l, frame.time_ns, index - l.last);
    l.time_ns = frame.time_ns;
    insert(l, index, frame);
}

void grid::place_by_counter(lane& l, const drv_frame_t& frame, std::uint64_t counter) {
    const std::int64_t step = step_of(l, l.counter, counter);
    const bool behind = step <= 0 && (step >= -reorder_ || awaited(l, l.last + step)); // again, or late
    // Behind a silence of more frames than may be out of order it is neither, if the counter went round.
    const bool silent = static_cast<double>(frame.time_ns - l.time_ns) > static_cast<double>(reorder_) * period_ns_;
    std::int64_t whole = step;
    const bool timed = (!behind || silent) && count_rounds(l, frame, whole);
    if (behind && !timed) {
        doubt_suspect(l);
        insert(l, l.last + step, frame);
        return;
    }
    if (!timed && (step < 0 || step > (l.loss ? window_ : reorder_))) {
        judge_jump(l, frame, counter);
        return;
    }
    doubt_suspect(l);
    l.counter = counter;
    move_on(l, frame, l.last + whole, false);
    recall_suspect(l);
}

/// The lane has come near the counter that was far off, or gone beyond it: it was right.
void grid::recall_suspect(lane& l) {
    std::uint64_t counter{};
    if (!l.suspected || !read_counter(l, l.suspect, counter)) return;
    const std::int64_t step = step_of(l, l.counter, counter);
    const drv_frame_t frame = l.suspect;
    decode(l, frame);
    if (std::abs(step) > reorder_ && (step > 0 || !awaited(l, l.last + step))) return;
    l.suspected = false;
    place_by_counter(l, frame, counter);
}

/// A frame in its place came after a counter far off: it may have been on its way for long, a ninth one was not.
void grid::doubt_suspect(lane& l) {
    if (l.suspected && ++l.suspect_age > reorder_ / 2) drop_suspect(l);
}

/// The counter far off was one damaged frame.
void grid::drop_suspect(lane& l) {
    buses_[l.bus].decode_errors += l.suspected;
    l.suspected = false;
}

/// After a known loss or a long silence the clock tells how often the counter went round. @return it does, and agrees
bool grid::count_rounds(const lane& l, const drv_frame_t& frame, std::int64_t& step) const {
    const double pause_ns = static_cast<double>(frame.time_ns - l.time_ns);
    if (step == 1 || (!l.loss && pause_ns < 1e9 * longest_pause_s) || pause_ns <= 0 || pause_ns > longest_silence_ns)
        return false;
    const double range = std::ldexp(1.0, l.sequence->length) / static_cast<double>(l.stride);
    const double guess = pause_ns / period_ns_;
    const double rounds = std::max(0.0, std::round((guess - static_cast<double>(step)) / range));
    const double found = static_cast<double>(step) + rounds * range;
    if (found < 1 || std::abs(found - guess) > std::max(static_cast<double>(window_), 0.2 * guess)) return false;
    step = std::llround(found);
    return true;
}

/// A counter far off: one damaged frame, or did frames get lost, or did the sender jump or restart? Two frames that
/// agree decide, in whichever order they came.
void grid::judge_jump(lane& l, const drv_frame_t& frame, std::uint64_t counter) {
    std::uint64_t before{};
    if (l.suspected) {
        read_counter(l, l.suspect, before);
        const std::int64_t apart = step_of(l, before, counter);
        if (apart == 0) {
            ++buses_[l.bus].duplicate;
            return;
        }
        const auto ahead = [&](std::uint64_t c) {
            const std::int64_t step = step_of(l, l.counter, c);
            return step > 0 && step <= window_;
        };
        if (std::abs(apart) <= (ahead(before) && ahead(counter) ? window_ : reorder_)) {
            const drv_frame_t suspect = l.suspect;
            l.suspected = false;
            accept_jump(l, apart > 0 ? suspect : frame);
            const drv_frame_t& later = apart > 0 ? frame : suspect;
            decode(l, later);
            place_by_counter(l, later, apart > 0 ? counter : before);
            return;
        }
        drop_suspect(l); // nothing followed the one before
    }
    l.suspected = true;
    l.suspect_age = 0;
    l.suspect = frame;
}

/// The lane goes on at this frame.
void grid::accept_jump(lane& l, const drv_frame_t& frame) {
    std::uint64_t counter{};
    read_counter(l, frame, counter);
    const std::int64_t step = step_of(l, l.counter, counter);
    const std::int64_t index = step > 0 ? l.last + step : place_restart(l, frame, counter);
    l.counter = counter;
    decode(l, frame);
    move_on(l, frame, index, false);
}

/// The stream ends and nothing can confirm a jump any more: one ahead is taken for a loss, one back for damage.
void grid::end_suspicion(lane& l) {
    std::uint64_t counter{};
    if (!l.suspected || !read_counter(l, l.suspect, counter)) return;
    const std::int64_t step = step_of(l, l.counter, counter);
    if (step <= 0 || step > window_) {
        drop_suspect(l);
        return;
    }
    l.suspected = false;
    accept_jump(l, drv_frame_t(l.suspect));
}

/// The sender's counter restarted: beside lanes that did so already, else by time, at least one sample apart.
std::int64_t grid::place_restart(const lane& l, const drv_frame_t& frame, std::uint64_t counter) const {
    std::int64_t index{};
    if (kin_of(l, counter, index) && index > l.last + 1) return index;
    const double pause = static_cast<double>(frame.time_ns - l.time_ns) / period_ns_;
    return l.last + (pause > 2 && pause < longest_silence_ns / period_ns_ ? std::llround(pause) : 2);
}

/// Is the sample still waiting for this lane, or does it hold just these numbers (a frame that came twice)?
bool grid::awaited(const lane& l, std::int64_t index) const {
    if (index < 0 || index >= opened_ || index < opened_ - mask_) return false;
    if (!present(index)[&l - lanes_.data()]) return index >= next_;
    const double* numbers = values_.data() + static_cast<std::size_t>(index & mask_) * width_;
    for (std::size_t i = 0; i < l.channels.size(); ++i)
        if (numbers[l.channels[i]] != decoded_[i]) return false;
    return true;
}

void grid::note_loss(lane& l, std::int64_t from, std::int64_t to, bool pause, std::int64_t within) {
    cause_mark& mark = l.marks[l.mark_count++ % l.marks.size()];
    mark.first = from;
    mark.last = to;
    mark.within = within;
    mark.cause = l.loss & DRV_LOSS_LINK       ? gap_cause::link_down
                 : l.loss & DRV_LOSS_OVERFLOW ? gap_cause::socket_overflow
                 : l.loss & DRV_LOSS_DRIVER   ? gap_cause::driver
                 : l.loss & DRV_LOSS_CRC      ? gap_cause::crc
                 : pause                      ? gap_cause::stall
                                              : gap_cause::sequence;
}

} // namespace okid_host
