// SPDX-License-Identifier: MIT
// PURPOSE  lanes whose frames have no counter: the next frame is the next sample, unless the stamps prove a loss
// METHOD   an arrival is never early and may be late by any amount: a burst, a sender or a reader that stalls and
//          catches up. The line of least delays (drv_clock_fit, from the last frame of each burst) says when a frame
//          was due. A late frame waits. If one behind it comes in time, the count is right and nothing was lost. If
//          all frames within the decision time are at least a sample later than those of the decision time before,
//          and do not catch up, samples are missing: as many as the least late frame is later by. The order of frames
//          never changes
#include "grid.hpp"

#include "grid_bounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace okid_host {
namespace {

constexpr double least_early = 0.25;     // periods by which arrivals are taken to be early of the line, at least
constexpr double remembers = 0.999;      // a frame, of how early the earliest was
constexpr double longest_beat_s = 1;     // a lane that pauses longer has stalled
constexpr double clock_set_ns = -1e9;    // so early is nothing but a clock that was set
constexpr double longest_periods = 20;   // a frame later than this shows nothing of the line
constexpr double rate_ppm = 300;         // by which a sensor may miss its nominal rate
constexpr double same_burst = 0.5;       // periods between two frames that were handed over together
constexpr double one_beat = 0.7;         // a silence of a period, give or take so much, held no loss
constexpr double longer_silence = 1.5;   // periods; a silence longer by so much than others is not of the bursts
constexpr double sure_of_number = 0.2;   // periods, deviation
constexpr double looks_again = 0.125;    // of the decision time
constexpr double a_silence = 0.125;      // of the decision time
constexpr double cut_off = 0.055;        // of the decision time: frames at the end of a stream that tell a loss
constexpr double held_up_s = 0.1;        // a busy computer may be late by so much until the stream ends
constexpr double half_a_sample = 0.55;   // periods: later than before by so much, one may be missing
constexpr double raster = 0.3;           // periods by which polls may miss their raster
constexpr std::int64_t flicker_ends = 8; // frames: a flicker lasts until the slip
constexpr double one_poll = 0.2;         // periods between two samples of one poll, at most
constexpr double go_on = 0.25;           // of the pairs before the shift are as many behind it, at least
constexpr double early_by_one = 0.35;    // periods by which arrivals that are a period early may differ
constexpr double no_chance = 9.2;        // -log of a chance of one in ten thousand
constexpr double pairs_remembered = 1.0 / 65536; // a burst forgets so much of how often two came together
constexpr double silent = 0.4;             // of the time a silent lane has: then its last burst is taken for cut off
constexpr double most_known = 256;         // bursts that tell how late they are
constexpr double longest_decision = 0.75;  // of the time a silent lane has
constexpr double forgets_spread = 0.998;   // a burst, of how late the last frame of a burst was
constexpr std::int64_t ahead_frames = 512; // in a row before their time: the line is wrong

std::uint64_t tick_of(std::int64_t index) { return static_cast<std::uint64_t>(index + (std::int64_t{1} << 40)); }

} // namespace

/// The line begins here: the newest frame placed was due at `due_ns`.
void grid::begin_cadence(lane& l, double due_ns) {
    const drv_clock_config_t clock{rate_hz_, 64, DRV_CLOCK_LATE, 2 / rate_hz_, rate_ppm};
    (void)drv_clock_fit_init(&l.clock, &clock);
    l.phase_ns = due_ns;
    l.beat_ns = period_ns_;
    l.early = 0;
    l.on_time = 0.5 + least_early;
    l.newest_ns = l.tail_ns = std::llround(due_ns);
    l.tail = l.last;
    l.ahead = l.in_burst = 0;
    l.usual = {HUGE_VAL, HUGE_VAL};
    l.usual_from = l.floor_from = l.last;
    l.floor_count = 0;
    l.floor_now = HUGE_VAL;
    l.patience = static_cast<double>(hold_);
    l.late.reserve(most_held_ + 1);
}

/// Lateness of a frame in periods, when `before` more stand between it and the newest frame placed.
double grid::lateness(const lane& l, const drv_frame_t& frame, std::size_t before) const {
    return (static_cast<double>(frame.time_ns) - l.phase_ns) / l.beat_ns - 1 - static_cast<double>(before);
}

void grid::place_by_cadence(lane& l, const drv_frame_t& frame) {
    const double ahead = static_cast<double>(frame.time_ns) - l.phase_ns;
    if (ahead < clock_set_ns || ahead > longest_silence_ns) {
        settle(l, frame.time_ns, true);
        begin_cadence(l, static_cast<double>(frame.time_ns) - period_ns_);
        beat(l, frame, 1);
        return;
    }
    late_lanes_ += l.late.empty();
    l.late.push_back({frame, 0});
    late_frame& held = l.late.back();
    held.time_ns = std::max(frame.time_ns, l.newest_ns); // stamps of one lane never run backwards
    // A silence is no evidence: it counts as much as that between two bursts.
    l.heard_ns += std::min<std::int64_t>(held.time_ns - l.newest_ns,
                                         std::llround(a_silence * static_cast<double>(hold_) * period_ns_));
    held.heard_ns = l.heard_ns;
    l.newest_ns = held.time_ns;
    held.loss = l.loss; // it tells where something was lost, and why
    l.loss = 0;
    settle(l, held.time_ns, false);
}

/// Lanes whose frames have waited long enough, by the time of another lane.
void grid::settle_overdue(std::int64_t now_ns) {
    if (late_lanes_ == 0) return;
    for (lane& l : lanes_)
        if (l.heard && !l.late.empty()) settle(l, now_ns, false);
}

/// Was this waiting frame handed over together with the one before it?
bool grid::together(const lane& l, std::size_t which) const {
    return static_cast<double>(l.late[which].time_ns - l.late[which - 1].time_ns) <= same_burst * period_ns_;
}

/// The last waiting frame that was handed over together with this one.
std::size_t grid::burst_end(const lane& l, std::size_t of) const {
    while (of + 1 < l.late.size() && together(l, of + 1)) ++of;
    return of;
}

/// Lateness of the frames that came since, up to the first one on time. A burst whose end is lost has no known
/// lateness: the frames behind it show it.
void grid::look_at_late(lane& l) {
    for (; l.seen < l.late.size() && (l.seen == l.placed || l.least > l.on_time); ++l.seen) {
        const double late = lateness(l, l.late[l.seen], l.seen - l.placed);
        const bool known = l.seen > l.placed + 1 || (l.late[l.seen].loss && 2 * l.frames >= 3 * l.bursts);
        const bool first =
            l.seen == l.placed ||
            (known && !together(l, l.seen) && burst_end(l, l.placed) + 1 == l.seen && !loss_reported(l, l.seen - 1));
        if (first || late < l.least + as_late) l.which = l.seen;
        l.least = first ? late : std::min(l.least, late);
    }
}

/// The next `count` waiting frames follow each other without a loss.
void grid::place_late(lane& l, std::size_t count) {
    for (const std::size_t end = l.placed + count; l.placed < end; ++l.placed) {
        beat(l, l.late[l.placed], 1);
    }
    l.seen = l.placed;
    l.patience = static_cast<double>(hold_);
}

/// Place the frames that need not wait any longer.
void grid::settle(lane& l, std::int64_t now_ns, bool all) {
    if (l.late.empty()) return;
    const double since = static_cast<double>(now_ns - l.late.back().time_ns) / period_ns_;
    const bool ended = all || since > silent * static_cast<double>(lag_);
    while (l.placed < l.late.size()) {
        const std::size_t before = l.placed;
        look_at_late(l);
        if (l.least <= l.on_time)
            place_late(l, l.which - l.placed + 1);
        else
            judge_late(l, ended);
        if (l.placed == before) break;
    }
    if (l.placed == l.late.size() || l.placed > most_held_ / 2) {
        l.late.erase(l.late.begin(), l.late.begin() + static_cast<std::ptrdiff_t>(l.placed));
        l.seen -= l.placed;
        l.which -= std::min(l.which, l.placed);
        l.placed = 0;
    }
    late_lanes_ -= l.late.empty();
}

/// All waiting frames are late.
void grid::judge_late(lane& l, bool ended) {
    const double waited = static_cast<double>(l.late.back().heard_ns - l.late[l.placed].heard_ns) / period_ns_;
    std::int64_t times{};
    const bool enough = waited > (ended ? cut_off * static_cast<double>(hold_) : l.patience);
    const bool alike = enough && bursts_alike(l, times);
    const std::size_t before = l.placed, waiting = l.late.size() - l.placed;
    if (enough && (!ended || times >= cut_off_bursts)) judge_shift(l, alike, times, waited, ended);
    if (l.placed != before) return;
    if (ended)
        place_late(l, 1); // a burst that was cut off
    else if (waiting >= most_held_ - 1)
        place_late(l, 1 + waiting / 4); // more than can wait came in less than the decision time: a stall made up for
}

/// They have been late long enough. Decide: only late, polls slipped, samples missing, or wait for more.
void grid::judge_shift(lane& l, bool alike, std::int64_t times, double waited, bool ended) {
    const std::size_t first = l.which - l.placed + 1;
    const double look_again = waited + looks_again * static_cast<double>(hold_);
    if (only_late(l, ended)) {
        place_late(l, first);
        return;
    }
    if (catches_up(l)) {
        if (ended)
            place_late(l, l.late.size() - l.placed);
        else
            l.patience = look_again;
        return;
    }
    const double more = l.least - usually_late(l);
    auto lost = static_cast<std::int64_t>(std::floor(more + 1 - a_sample));
    double by = 0, by_std = 0;
    const bool never_calm = restless(l), apart_now = never_calm && floors_apart(l, by, by_std);
    if (apart_now && lost > 0) lost = std::max<std::int64_t>(1, std::llround(by));
    const bool flicker = lost == 1 && flickered(l);
    if (lost <= 0 || flicker || (lost == 1 && alike && may_slip(l))) {
        l.uncertain += lost <= 0 && more > half_a_sample;
        if (lost > 0) slip(l, 1);
        if (flicker) { // that was one
            l.slip_at = never;
            l.pair_count = 0;
        }
        place_late(l, first);
        return;
    }
    const bool reported = loss_reported(l, l.which);
    const bool few = ended && lost == 1 && times < 4 * cut_off_bursts; // of one sample little is seen
    const bool stays = !few && (!never_calm || apart_now) && !on_the_move(l) && shift_stays(l, more, times, ended);
    if (reported || stays || (ended && !never_calm && static_cast<double>(lost) > held_up_s * rate_hz_)) {
        const std::size_t end = burst_end(l, l.placed);
        const bool cut = end < l.which && lateness(l, l.late[end], end - l.placed) < l.least - as_late;
        if (cut && !loss_reported(l, end)) {
            place_late(l, end - l.placed + 1);
            return;
        }
        if (!reported && stays &&
            !steady(l, l.placed, l.which + 1, ended)) { // they were late, and the loss is behind them
            place_late(l, first);
            return;
        }
        l.uncertain += (alike && !reported && (lost == 1 || in_two_steps(l))) || by_std > sure_of_number;
        place_after_loss(l, lost);
        return;
    }
    const double since = static_cast<double>(l.late.back().time_ns - l.late[l.placed].time_ns) / period_ns_;
    if (!ended &&
        std::max(since, static_cast<double>(opened_ - next_)) < longest_decision * static_cast<double>(lag_)) {
        l.patience = look_again;
        return;
    }
    ++l.uncertain;
    place_late(l, first);
}

/// The silence before a waiting frame, periods.
double grid::silence_before(const lane& l, std::size_t which) const {
    const std::int64_t before_ns = which > l.placed ? l.late[which - 1].time_ns : l.time_ns;
    return static_cast<double>(l.late[which].time_ns - before_ns) / period_ns_;
}

/// A silence of so many periods is that between one poll and the next, or the one after that.
bool grid::on_raster(double silence) { return std::abs(silence - 1) < raster || std::abs(silence - 2) < raster; }

/// The burst at hand: two of one poll.
bool grid::is_pair(const lane& l) { return l.in_burst == 2 && l.inside < one_poll && on_raster(l.silence); }

/// A burst has ended. There is one sample a poll, and now two between polls on their raster: one poll was too early for
/// its sample. If many such pairs come and the polls have not slipped when they end, there was a loss meanwhile.
void grid::note_pair(lane& l, double silence_behind) {
    l.singles += 1 - pairs_remembered * l.singles;
    l.pairs -= pairs_remembered * l.pairs;
    if (l.flickers && l.last - l.newest_pair > slip_apart) {
        l.uncertain += l.slips == l.slips_before;
        l.flickers = false;
    }
    if (!is_pair(l) || !on_raster(silence_behind)) return;
    ++l.pairs;
    l.newest_pair = l.pair_at[l.pair_count++ % l.pair_at.size()] = l.last;
    if (l.flickers || 2 * l.frames >= 3 * l.bursts || !pairs_gather(l, 0, 0)) return;
    l.flickers = true;
    l.slips_before = l.slips;
}

/// Up to the newest frame placed there were more pairs than chance gives.
/// @param pairs  1 if the burst at hand is one that is not counted yet;  behind: how many a frame there are behind it
bool grid::pairs_gather(const lane& l, double pairs, double behind) const {
    const double known = l.pairs + pairs;
    const std::size_t most = std::min(l.pair_count, l.pair_at.size());
    std::int64_t since = l.last;
    for (std::size_t k = 0;; ++k) {
        const auto frames = static_cast<double>(l.last - since + 1);
        const double expected = (1 + known - pairs) / (1 + l.singles) * frames;
        if (expected < pairs && behind * frames <= go_on * pairs &&
            pairs * std::log(pairs / expected) - pairs + expected > no_chance)
            return true;
        if (k >= most) return false;
        since = l.pair_at[(l.pair_count - 1 - k) % l.pair_at.size()];
        if (pairs == 0 && l.last - since > flicker_ends) return false;
        ++pairs;
    }
}

/// A sensor that drifts against the polls of an adapter is missed by a poll now and then, and ever more often, until
/// every poll misses it. Until then pairs of samples come, many more than usual. Before a loss there are none, and
/// behind a loss they go on.
bool grid::flickered(const lane& l) const {
    if (2 * l.frames >= 3 * l.bursts || loss_reported(l, l.which)) return false;
    double behind = 0;
    for (std::size_t i = l.placed + 2; i + 1 < l.late.size(); ++i)
        behind += together(l, i) && !together(l, i - 1) && !together(l, i + 1) && on_raster(silence_before(l, i - 1));
    return pairs_gather(l, is_pair(l), behind / static_cast<double>(l.late.size() - l.placed));
}

/// The line stays; the samples on it move by `by` places.
void grid::slip(lane& l, std::int64_t by) {
    l.slips += by;
    l.tail -= by;
    l.phase_ns += static_cast<double>(by) * l.beat_ns;
    l.uncertain += by > 0;
    l.slip_at = by > 0 ? l.last : never;
}

/// `lost` samples are missing, at the latest before the first frame that is about as early as any. They are placed
/// where the bus reported a loss and the arrivals allow it; else at a silence longer than that before the oldest
/// waiting frame; else before that frame, together with how much later they may be missing.
void grid::place_after_loss(lane& l, std::int64_t lost) {
    const std::size_t first = l.placed;
    const auto silence = [&](std::size_t i) { return silence_before(l, i); };
    std::size_t last = first, place = first;
    while (last < l.which && lateness(l, l.late[last], last - first) >= l.least + as_late) ++last;
    for (std::size_t i = first + 1; i <= last; ++i)
        if (silence(i) > silence(place) + longer_silence) place = i;
    std::int64_t reported = 0;
    const std::size_t end = last + (l.which > last ? 2 : 1); // the last of a burst may be the one
    for (std::size_t i = end; i-- > first;) {
        if (!l.late[i].loss || std::abs(silence(i) - 1) < one_beat) continue;
        ++reported;
        place = i;
    }
    place_late(l, place - first);
    if (l.last - l.slip_at <= slip_apart) { // that was no slip but a loss
        ++lost;
        slip(l, -1);
    }
    l.lost_at = l.last;
    const std::int64_t step = 1 + std::max<std::int64_t>(1, lost - std::max<std::int64_t>(0, reported - 1));
    beat(l, l.late[place], step, reported ? 0 : static_cast<std::int64_t>(std::max(last, place) - place));
    l.seen = l.placed = place + 1;
}

/// The lane's next frame stands `step` samples after the one before it.
void grid::beat(lane& l, const drv_frame_t& frame, std::int64_t step, std::int64_t within) {
    decode(l, frame);
    const bool pause = static_cast<double>(frame.time_ns - l.time_ns) > 1e9 * longest_beat_s;
    const std::uint8_t pending = l.loss;
    l.loss = frame.loss;
    const std::int64_t index = l.last + step;
    move_on(l, frame, index, pause, within);
    l.loss = pending;
    l.phase_ns += static_cast<double>(step) * l.beat_ns;
    follow_line(l, frame, index, static_cast<double>(frame.time_ns) - l.phase_ns);
}

/// A burst has ended with the frame before this one.
void grid::end_burst(lane& l, std::int64_t index) {
    if (l.tail < index) {
        (void)drv_clock_fit_add(&l.clock, tick_of(l.tail + l.slips), l.tail_ns);
        if (l.tail_late < 1) l.spread = std::max(forgets_spread * l.spread, l.tail_late);
    }
    const double later = l.tail_late - usually_late(l);
    l.known = std::min(l.known + 1, most_known);
    for (std::size_t k = 0; k < edges.size(); ++k) l.share[k] += ((later < edges[k]) - l.share[k]) / l.known;
    note_lateness(l, index);
    l.ahead = l.tail_late < -most_early ? l.ahead + l.in_burst : 0;
    l.frames += l.in_burst;
    ++l.bursts;
    l.in_burst = 0;
}

/// Bursts end anywhere between two samples. Where all of them end alike, that place is not known: its deviation is that
/// of a uniform law over the part of a period that was never seen between the earliest and the latest end.
double grid::place_std_s(const lane& l) const {
    const bool alone = std::all_of(lanes_.begin(), lanes_.end(), [&](const lane& o) { return o.bus == l.bus; });
    if (alone || l.sequence || 2 * l.frames < 3 * l.bursts || l.bursts < 8) return 0;
    return std::max(0.0, 1 - l.early - l.spread) * 1e-9 * period_ns_ / std::sqrt(12.0);
}

/// Only the last frame of a burst shows the line. An arrival is never early. Where arrivals are quantised (USB polls)
/// their least delay drifts slowly to and fro; the earliest recent ones show where it is now, and how far it goes.
void grid::follow_line(lane& l, const drv_frame_t& frame, std::int64_t index, double late_ns) {
    const double silence = static_cast<double>(frame.time_ns - l.tail_ns) / period_ns_;
    if (silence > same_burst) {
        note_pair(l, silence);
        end_burst(l, index);
        l.silence = silence;
    }
    l.inside = silence;
    ++l.in_burst;
    l.tail_late = late_ns / period_ns_;
    const bool tells = late_ns < longest_periods * period_ns_ && late_ns > -most_early * period_ns_;
    l.tail = tells || l.clock.points == 0 ? index : index + 1; // one that is too late or too early is no tail
    l.tail_ns = frame.time_ns;
    std::int64_t expected{};
    if (l.ahead >= flicker_ends && 2 * l.frames < 3 * l.bursts && std::abs(l.tail_late + 1) < early_by_one) {
        slip(l, -1); // polls that are ever later against the samples have got one earlier
        l.ahead = 0;
        l.tail_late += 1;
        l.pair_count = 0;
        l.tail = index;
    }
    if (l.ahead > ahead_frames) {
        l.slip_at = never; // back again
        begin_cadence(l, static_cast<double>(frame.time_ns));
    } else if (drv_clock_fit_map(&l.clock, tick_of(index + l.slips), &expected, nullptr) == 0) {
        double ppm{};
        (void)drv_clock_fit_rate(&l.clock, &ppm, nullptr);
        l.beat_ns = period_ns_ * (1 + 1e-6 * ppm);
        const double early = static_cast<double>(expected - frame.time_ns) / period_ns_;
        if (early <= most_early) l.early = std::max(remembers * l.early, early);
        const double line_ns = static_cast<double>(expected) - l.early * period_ns_;
        const double moved = (l.phase_ns - line_ns) / period_ns_;
        for (double& least : l.usual) least += moved;
        l.moved += moved;
        l.floor_now += moved;
        l.tail_late += moved;
        l.phase_ns = line_ns;
        l.on_time = 0.5 + std::clamp(l.early, least_early, most_early);
    } else if (late_ns < 0) {
        l.phase_ns = static_cast<double>(frame.time_ns); // no line yet: the earliest so far
    }
}

} // namespace okid_host
