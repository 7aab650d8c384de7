// SPDX-License-Identifier: MIT
// Lanes whose frames have no counter: placed by their arrival on the line of least delays (drv_clock_fit). An arrival is
// never early and may be late by a burst (an adapter that hands on every 16 ms, a reader that slept): a late frame waits,
// and either one behind it is on time, then nothing was lost before that one, or all stay late, and by as much as the
// least late one of them samples are missing.
#include "grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace okid_host {
namespace {

constexpr double least_early = 0.25;    // periods by which arrivals are taken to be early of the line, at least
constexpr double most_early = 0.5;      // and at most: what is earlier has the wrong place
constexpr double remembers = 0.999;     // a frame, of how early the earliest was
constexpr double longest_beat_s = 1;    // a lane that pauses longer has stalled
constexpr double clock_set_ns = -1e9;   // so early is nothing but a clock that was set
constexpr double told_periods = 20;     // a frame later than this tells nothing of the line
constexpr double rate_ppm = 300;        // by which a sensor may miss its nominal rate
constexpr double one_beat = 0.7;        // a silence of a period, give or take so much, held no loss
constexpr double one_burst = 1.5;       // periods; a silence longer by so much than others is not of the bursts
constexpr double as_late = 0.3;         // periods
constexpr double cut_off = 0.3;         // of the longest wait: frames that came within it may lack the rest of a burst
constexpr double forgets = 0.99;        // a frame, of how late the latest was
constexpr std::size_t whole_burst = 64; // frames that may wait at once, beside those of the longest wait

std::uint64_t tick_of(std::int64_t index) { return static_cast<std::uint64_t>(index + (std::int64_t{1} << 40)); }

} // namespace

/// The line begins here.
void grid::begin_cadence(lane& l, std::int64_t time_ns) {
    const drv_clock_config_t clock{rate_hz_, 64, DRV_CLOCK_LATE, 2 / rate_hz_, rate_ppm};
    (void)drv_clock_fit_init(&l.clock, &clock);
    l.phase_ns = static_cast<double>(time_ns);
    l.beat_ns = period_ns_;
    l.early = 0;
    l.on_time = 0.5 + least_early;
    l.late.reserve(static_cast<std::size_t>(hold_) + whole_burst);
}

/// By how many periods a frame is late when `before` more stand between it and the newest one placed.
double grid::lateness(const lane& l, const drv_frame_t& frame, std::size_t before) const {
    return (static_cast<double>(frame.time_ns) - l.phase_ns) / l.beat_ns - 1 - static_cast<double>(before);
}

/// A frame that says what another one says, stamped alike, or about alike and so early that there is no place for it.
bool grid::is_double(const lane& l, const drv_frame_t& frame, bool early) const {
    const std::int64_t near_ns = early ? std::llround(0.5 * l.beat_ns) : 0;
    const auto same = [&](const drv_frame_t& other) {
        return std::abs(other.time_ns - frame.time_ns) <= near_ns && other.len == frame.len &&
               std::memcmp(other.data, frame.data, frame.len) == 0;
    };
    return std::any_of(l.late.begin(), l.late.end(), same) || std::any_of(l.beats.begin(), l.beats.end(), same);
}

/// A frame that was overtaken: its stamp is older than that of the newest one placed, and its sample is still awaited, or
/// came before.
bool grid::overtaken(lane& l, const drv_frame_t& frame) {
    const std::int64_t index = l.last + std::llround((static_cast<double>(frame.time_ns) - l.phase_ns) / l.beat_ns);
    if (frame.time_ns >= l.time_ns || index >= l.last || !awaited(l, index)) return false;
    insert(l, index, frame);
    return true;
}

void grid::place_by_cadence(lane& l, const drv_frame_t& frame) {
    const double ahead = static_cast<double>(frame.time_ns) - l.phase_ns;
    if (ahead < clock_set_ns || ahead > longest_silence_ns) {
        settle(l, frame.time_ns, true);
        begin_cadence(l, frame.time_ns - std::llround(period_ns_));
        beat(l, frame, 1);
        return;
    }
    const auto after = [](const drv_frame_t& a, const drv_frame_t& b) { return a.time_ns < b.time_ns; };
    const auto at = std::upper_bound(l.late.begin(), l.late.end(), frame, after);
    const auto before = static_cast<std::size_t>(at - l.late.begin());
    if (is_double(l, frame, lateness(l, frame, before) < -one_beat)) {
        ++buses_[l.bus].duplicate;
        return;
    }
    if (overtaken(l, frame)) return;
    late_lanes_ += l.late.empty();
    const auto held = l.late.insert(at, frame);
    held->loss = l.loss; // it tells where something was lost, and why
    l.loss = 0;
    settle(l, frame.time_ns, false);
}

/// Lanes whose frames have waited for long enough by another lane's time.
void grid::settle_overdue(std::int64_t now_ns) {
    if (late_lanes_ == 0) return;
    for (lane& l : lanes_)
        if (!l.late.empty()) settle(l, now_ns, false);
}

/// Place those that need not wait any longer.
void grid::settle(lane& l, std::int64_t now_ns, bool all) {
    if (l.late.empty()) return;
    const auto hold = static_cast<double>(hold_);
    const bool ended = all || static_cast<double>(now_ns - l.late.back().time_ns) > 0.5 * hold * period_ns_;
    std::size_t first = 0;
    while (first < l.late.size()) {
        double least = lateness(l, l.late[first], 0);
        std::size_t which = first;
        for (std::size_t i = first + 1; i < l.late.size() && least > l.on_time; ++i) {
            const double late = lateness(l, l.late[i], i - first);
            if (late < least + as_late) which = i;
            least = std::min(least, late);
        }
        if (least <= l.on_time) {
            for (; first <= which; ++first) {
                l.usual = std::max(forgets * l.usual, lateness(l, l.late[first], 0));
                beat(l, l.late[first], 1);
            }
            continue;
        }
        const double waited = static_cast<double>(l.late.back().time_ns - l.late[first].time_ns) / period_ns_;
        if (waited > (ended ? cut_off * hold : hold) || (ended && least > l.usual + one_beat))
            first = place_after_loss(l, first, which, static_cast<std::int64_t>(least + 1 - l.on_time));
        else if (ended || l.late.size() - first >= static_cast<std::size_t>(hold_) + whole_burst - 1)
            beat(l, l.late[first++], 1); // a burst that was cut off, or is more than can wait
        else
            break;
    }
    l.late.erase(l.late.begin(), l.late.begin() + static_cast<std::ptrdiff_t>(first));
    late_lanes_ -= l.late.empty();
}

/// `lost` samples are missing before the frame `last`: where the bus told of a loss and the arrivals do not speak against
/// it, else at a silence that is longer than that before the first. @return the frame to go on with
std::size_t grid::place_after_loss(lane& l, std::size_t first, std::size_t last, std::int64_t lost) {
    const auto silence = [&](std::size_t i) {
        const std::int64_t before = i > first ? l.late[i - 1].time_ns : l.time_ns;
        return static_cast<double>(l.late[i].time_ns - before) / period_ns_;
    };
    std::size_t place = first;
    for (std::size_t i = first + 1; i <= last; ++i)
        if (silence(i) > silence(place) + one_burst) place = i;
    std::int64_t told = 0;
    for (std::size_t i = last + 1; i-- > first;) {
        if (!l.late[i].loss || std::abs(silence(i) - 1) < one_beat) continue;
        ++told;
        place = i;
    }
    for (std::size_t i = first; i < place; ++i) beat(l, l.late[i], 1);
    beat(l, l.late[place], 1 + std::max<std::int64_t>(1, lost - std::max<std::int64_t>(0, told - 1)));
    return place + 1;
}

/// The lane's next frame stands `step` samples after the one before it.
void grid::beat(lane& l, const drv_frame_t& frame, std::int64_t step) {
    decode(l, frame);
    l.beats[l.beat_at++ % l.beats.size()] = frame;
    const bool pause = static_cast<double>(frame.time_ns - l.time_ns) > 1e9 * longest_beat_s;
    const std::uint8_t pending = l.loss;
    l.loss = frame.loss;
    const std::int64_t index = l.last + step;
    move_on(l, frame, index, pause);
    l.loss = pending;
    l.phase_ns += static_cast<double>(step) * l.beat_ns;
    const double late_ns = static_cast<double>(frame.time_ns) - l.phase_ns;
    if (late_ns < told_periods * period_ns_) (void)drv_clock_fit_add(&l.clock, tick_of(index), frame.time_ns);
    std::int64_t expected = 0;
    if (drv_clock_fit_map(&l.clock, tick_of(index), &expected, nullptr) == 0)
        follow_line(l, frame, expected);
    else if (late_ns < 0)
        l.phase_ns = static_cast<double>(frame.time_ns); // no line yet: the earliest so far
}

/// The newest frame was due at `expected` by the line. An arrival is never early: where arrivals are quantised (USB polls)
/// their least delay goes slowly to and fro, and the earliest of late tell where it is now, and how far it goes.
void grid::follow_line(lane& l, const drv_frame_t& frame, std::int64_t expected) {
    double ppm = 0;
    (void)drv_clock_fit_rate(&l.clock, &ppm, nullptr);
    l.beat_ns = period_ns_ * (1 + 1e-6 * ppm);
    const double early = static_cast<double>(expected - frame.time_ns) / period_ns_;
    if (early <= most_early) l.early = std::max(remembers * l.early, early);
    l.phase_ns = static_cast<double>(expected) - l.early * period_ns_;
    l.on_time = 0.5 + std::clamp(l.early, least_early, most_early);
}

} // namespace okid_host
