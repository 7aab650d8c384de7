// SPDX-License-Identifier: MIT
// PURPOSE  the first place of a lane on the grid: which samples of several lanes were taken together
// METHOD   lanes whose counters stand close together count the same samples. Every other lane is placed by the time its
//          first frame was due: frames are gathered for half a second, and the earliest arrivals among them give the line
//          (a single stamp may be late by a whole burst). Lanes of one bus whose frames are handed over several at a time
//          stay together by arrival count, unless their lines are more than a sample apart, or bursts end with frames of
//          both, so that both lines are known
#include "grid.hpp"

#include "wrapped_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace okid_host {
namespace {

constexpr double gather_s = 0.5;      // frames of so long tell where a lane stands
constexpr double gather_periods = 8;  // and of at least so many periods
constexpr double agree = 0.3;         // periods: the two halves of the gathered frames tell the same line
constexpr double close_by = 0.25;     // periods: frames so close were handed over together
constexpr double bursty_share = 0.1;  // of a lane's frames: from then on its stamps are those of bursts
constexpr double burst_offset = 1.25; // periods by which the lines of two bursty lanes may differ and count as one
constexpr double looks_late =
    0.35; // of a period: less than half, for some adapters wait for the last sample of a burst
constexpr std::int64_t one_read = 30000; // ns: two frames of one bus so close came with one read, no bus is so fast
constexpr double counted_drift = 5e-4;   // by which a line through the earliest stamps may turn later
constexpr std::int64_t half_least = 4;   // frames that a half needs to have a say

/// Two counters this close at the start count the same samples.
std::int64_t kinship(unsigned bits) { return bits >= 9 ? 64 : std::max<std::int64_t>(1, std::int64_t{1} << bits >> 3); }

} // namespace

/// Frame `number` of the lane came; the middle of the time in which frames are gathered is `middle_ns`.
void lane_start::add(std::int64_t number, std::int64_t time_ns, std::int64_t middle_ns, double period_ns) {
    if (frames == 0) first_ns = newest_ns = time_ns;
    const double late_ns = static_cast<double>(time_ns - first_ns) - static_cast<double>(number) * period_ns;
    if (static_cast<double>(time_ns - newest_ns) >= close_by * period_ns) {
        // The frame before this one was the last of its burst.
        spread_ns[0] = ends == 0 ? end_ns : std::min(spread_ns[0], end_ns);
        spread_ns[1] = ends == 0 ? end_ns : std::max(spread_ns[1], end_ns);
        ++ends;
    }
    end_ns = late_ns;
    const std::size_t half = time_ns > middle_ns;
    least_ns[half] = count[half]++ == 0 ? late_ns : std::min(least_ns[half], late_ns);
    close += frames > 0 && static_cast<double>(time_ns - newest_ns) < close_by * period_ns;
    newest_ns = time_ns;
    ++frames;
}

/// The line of the earliest arrivals at the lane's first frame.
double lane_start::earliest_ns(double period_ns) const {
    const double first = count[0] ? least_ns[0] : least_ns[1], second = count[1] ? least_ns[1] : least_ns[0];
    const bool both = count[0] >= half_least && count[1] >= half_least && std::abs(first - second) < agree * period_ns;
    return static_cast<double>(first_ns) + (both ? (first + second) / 2 : std::min(first, second));
}

/// When the lane's first frame was due by the earliest arrivals.
double lane_start::due_ns(double period_ns) const {
    double due = earliest_ns(period_ns);
    // Who looks now and then is late by up to a period at every look: by half of it on the mean where all looks tell alike.
    if (ends > 0 && static_cast<double>(close) > bursty_share * static_cast<double>(frames))
        due -= looks_late * std::max(0.0, period_ns - (spread_ns[1] - spread_ns[0]));
    return due;
}

bool lane_start::bursty() const {
    return static_cast<double>(std::max(close, shared)) > bursty_share * static_cast<double>(frames);
}

double grid::gather_ns() const { return std::max(1e9 * gather_s, gather_periods * period_ns_); }

/// Before the grid begins frames wait until every lane was heard and its line is known, or until no more can wait.
void grid::hold_until_anchored(lane& l, const drv_frame_t& frame) {
    held_.emplace_back(static_cast<int>(&l - lanes_.data()), frame);
    if (!l.waiting) {
        l.waiting = true;
        ++heard_;
        all_heard_ns_ = frame.time_ns;
        by_time_ = heard_ == lanes_.size() && placed_by_time();
    }
    const bool gathered = !by_time_ || std::abs(static_cast<double>(frame.time_ns - all_heard_ns_)) > gather_ns();
    if ((heard_ == lanes_.size() && gathered) || held_.size() >= most_before_) anchor();
}

/// Is there a lane whose place depends on stamps? Counters of the lanes heard so far are compared.
bool grid::placed_by_time() const {
    if (std::any_of(lanes_.begin(), lanes_.end(), [](const lane& l) { return l.pages; })) return true; // find_strides()
    if (lanes_.size() == 1) return false;
    const lane* root = nullptr;
    for (const auto& [which, frame] : held_) {
        const lane& l = lanes_[static_cast<std::size_t>(which)];
        std::uint64_t counter{}, first{};
        if (!read_counter(l, frame, counter)) return true;
        if (!root) root = &l;
        if (&l == root) continue;
        read_counter(*root, held_.front().second, first);
        const unsigned bits = std::min(l.sequence->length, root->sequence->length);
        if (std::abs(wrapped_step(first, counter, bits)) > kinship(bits) + static_cast<std::int64_t>(held_.size()))
            return true;
    }
    return false;
}

/// A lane whose counter stands close to this one. @return NULL when there is none
const grid::lane* grid::kin_of(const lane& l, std::uint64_t counter, std::int64_t& index) const {
    for (const lane& other : lanes_) {
        if (!other.heard || &other == &l || !other.sequence || other.stride != l.stride) continue;
        if (l.stride > 1 && !one_message(l, other)) continue;
        const unsigned bits = std::min(l.sequence->length, other.sequence->length);
        const std::uint64_t begin = counter - static_cast<std::uint64_t>(l.page - other.page);
        const std::int64_t apart = wrapped_step(other.counter, begin, bits);
        if (std::abs(apart) > kinship(bits)) continue;
        index = other.last + apart / l.stride;
        return &other;
    }
    return nullptr;
}

/// First pass: where each lane's first frame stands beside those of its family (lanes that count the same samples), and
/// by which line its frames came.
void grid::gather_starts(std::vector<lane_start>& starts) {
    std::vector<std::int64_t> numbers(lanes_.size(), 0), arrived(lanes_.size(), 0);
    std::vector<std::int64_t> bus_ns(buses_.size(), std::numeric_limits<std::int64_t>::min() / 2);
    std::vector<lane_start*> newest_of(buses_.size(), nullptr);
    const std::int64_t middle_ns = all_heard_ns_ + std::llround(gather_ns() / 2);
    for (const auto& [which, frame] : held_) {
        const auto w = static_cast<std::size_t>(which);
        lane& l = lanes_[w];
        lane_start& its = starts[w];
        std::uint64_t counter{};
        const bool counted = read_counter(l, frame, counter);
        if (!l.heard) {
            l.last = 0;
            its.family = w;
            its.frame = &frame;
            if (const lane* kin = counted ? kin_of(l, counter, l.last) : nullptr)
                its.family = starts[static_cast<std::size_t>(kin - lanes_.data())].family;
            its.index = l.last;
            its.before = arrived;
            l.heard = true;
        } else {
            const std::int64_t step = counted ? step_of(l, l.counter, counter) : 1;
            if (step <= 0 || step > window_) continue;
            numbers[w] += step;
            l.last += step;
        }
        l.counter = counter;
        ++arrived[w];
        its.shared += frame.time_ns - bus_ns[l.bus] < one_read;
        if (newest_of[l.bus] && static_cast<double>(frame.time_ns - bus_ns[l.bus]) >= close_by * period_ns_) {
            ++newest_of[l.bus]->finishes;
            ++its.begins;
        }
        newest_of[l.bus] = &its;
        bus_ns[l.bus] = frame.time_ns;
        its.add(numbers[w], frame.time_ns, middle_ns, period_ns_);
    }
}

/// Which lane of a bus has the first frame of a sample, by the order of arrival: the one heard first. But a stream may begin
/// in the midst of a sample: if bursts begin with another one, whose identifier is lower too, it is that.
std::size_t grid::first_of_sample(const std::vector<lane_start>& starts, std::size_t bus) const {
    std::size_t heard = lanes_.size(), begins = lanes_.size();
    std::int64_t bursts = 0;
    for (std::size_t i = 0; i < lanes_.size(); ++i) {
        if (!starts[i].frame || lanes_[i].sequence || lanes_[i].bus != bus) continue;
        if (heard == lanes_.size() || starts[i].frame < starts[heard].frame) heard = i;
        if (begins == lanes_.size() || starts[i].begins > starts[begins].begins) begins = i;
        bursts += starts[i].begins;
    }
    const bool nearly_all = bursts >= half_least && 3 * starts[begins].begins > 2 * bursts;
    return nearly_all && starts[begins].frame->id < starts[heard].frame->id ? begins : heard;
}

/// By how many samples the first frame of lane `l` stands behind that of `root`, whose counters do not tell.
std::int64_t grid::start_offset(const std::vector<lane_start>& starts, std::size_t l, std::size_t root) const {
    const lane_start &own = starts[l], &other = starts[root];
    const double apart = (own.due_ns(period_ns_) - other.due_ns(period_ns_)) / period_ns_;
    if (!lanes_[l].sequence && !lanes_[root].sequence && lanes_[l].bus == lanes_[root].bus &&
        (own.bursty() || other.bursty())) {
        const std::size_t first = first_of_sample(starts, lanes_[l].bus);
        const auto sample = [&](std::size_t of) {
            const std::int64_t before = of == first ? 1 : starts[of].before[first];
            return before > 0 ? before - 1 : -starts[first].before[of];
        };
        const std::int64_t by_count = sample(l) - sample(root);
        if (std::min(own.finishes, other.finishes) >= 2 * half_least) { // the last of a burst tells its line
            const double exact = (own.earliest_ns(period_ns_) - other.earliest_ns(period_ns_)) / period_ns_;
            if (std::abs(exact - std::round(exact)) < agree) return std::llround(exact);
        }
        if (std::abs(apart - static_cast<double>(by_count)) <= burst_offset) return by_count;
    }
    return std::llround(apart);
}

/// All lanes were heard (or waiting has no end): sample 0 is the first one that every lane can have.
void grid::anchor() {
    anchored_ = true;
    find_strides();
    std::vector<lane_start> starts(lanes_.size());
    gather_starts(starts);
    const auto root = static_cast<std::size_t>(held_.front().first);
    const std::size_t none = lanes_.size();
    std::vector<std::int64_t> shift(lanes_.size(), 0); // of each family
    for (std::size_t i = 0; i < lanes_.size(); ++i) {
        if (!starts[i].frame || starts[i].family != i || i == root) continue;
        std::size_t beside = none; // a lane of the same bus that stands already, else the first one heard
        for (std::size_t k = 0; k < i && beside == none; ++k)
            if (starts[k].frame && !lanes_[k].sequence && lanes_[k].bus == lanes_[i].bus) beside = k;
        if (beside == none) beside = root;
        shift[i] = shift[starts[beside].family] + starts[beside].index + start_offset(starts, i, beside);
    }
    std::int64_t begin = std::numeric_limits<std::int64_t>::min();
    for (std::size_t i = 0; i < lanes_.size(); ++i)
        if (starts[i].frame) begin = std::max(begin, starts[i].index + shift[starts[i].family]);
    for (std::size_t i = 0; i < lanes_.size(); ++i) { // every lane back to just its first frame
        if (!starts[i].frame) continue;
        lane& l = lanes_[i];
        l.last = starts[i].index + shift[starts[i].family] - begin;
        settle_start(l, starts[i]);
    }
    for (const auto& [which, frame] : held_) { // second pass: for good
        lane& l = lanes_[static_cast<std::size_t>(which)];
        decode(l, frame);
        if (starts[static_cast<std::size_t>(which)].frame == &frame)
            insert(l, l.last, frame);
        else
            place(l, frame);
    }
    held_.clear();
    held_.shrink_to_fit();
}

/// The lane stands at its first frame, on the line of its earliest arrivals.
void grid::settle_start(lane& l, const lane_start& start) {
    l.time_ns = start.first_ns;
    l.loss = 0;
    read_counter(l, *start.frame, l.counter);
    const double due_ns = start.due_ns(period_ns_);
    if (l.sequence)
        l.phase_ns = due_ns;
    else
        begin_cadence(l, due_ns);
}

/// A lane that is first heard when the grid has begun. With the counter of another lane it has its place; else its frames
/// wait until they tell its line.
void grid::join(lane& l, const drv_frame_t& frame) {
    std::uint64_t counter{};
    if (l.page < 0 && read_counter(l, frame, counter))
        for (const lane& other : lanes_)
            if (l.page < 0 && other.heard && one_message(l, other)) find_page(l, counter, other, other.counter);
    if (read_counter(l, frame, counter) && l.late.empty() && kin_of(l, counter, l.last)) {
        l.heard = true;
        l.counter = counter;
        l.loss = 0;
        l.time_ns = frame.time_ns;
        l.phase_ns = static_cast<double>(frame.time_ns);
        insert(l, l.last, frame);
        return;
    }
    l.gone = false;
    late_lanes_ += l.late.empty();
    l.late.push_back({frame, 0});
    const bool gathered = static_cast<double>(frame.time_ns - l.late.front().time_ns) > gather_ns();
    if (gathered || lanes_.size() == 1 || l.late.size() >= most_held_) end_joining(l);
}

void grid::end_joining(lane& l) {
    const std::vector<late_frame> frames = std::move(l.late);
    l.late.clear();
    --late_lanes_;
    lane_start start;
    start.frame = &frames.front();
    const std::int64_t middle_ns = (frames.front().time_ns + frames.back().time_ns) / 2;
    std::int64_t number = 0;
    read_counter(l, frames.front(), l.counter);
    for (const late_frame& frame : frames) {
        std::uint64_t counter{};
        if (read_counter(l, frame, counter)) {
            const std::int64_t step = step_of(l, l.counter, counter);
            if (step < 0 || step > window_) continue;
            number += step;
            l.counter = counter;
        }
        start.add(number, frame.time_ns, middle_ns, period_ns_);
        number += !l.sequence;
    }
    const lane* beside = nullptr;
    for (const lane& other : lanes_)
        if (other.heard && (!beside || (other.bus == l.bus && beside->bus != l.bus))) beside = &other;
    l.last = beside ? beside->last + std::llround((start.due_ns(period_ns_) - beside->phase_ns) / period_ns_) : 0;
    settle_start(l, start);
    l.heard = true;
    for (const late_frame& frame : frames) {
        decode(l, frame);
        if (&frame == start.frame)
            insert(l, l.last, frame);
        else
            place(l, frame);
    }
}

/// The line of a counted lane: through the earliest of its stamps, which may turn later slowly.
void grid::follow_counted(lane& l, std::int64_t time_ns, std::int64_t step) {
    const double due_ns = l.phase_ns + static_cast<double>(step) * period_ns_ * (1 + counted_drift);
    l.phase_ns = std::min(due_ns, static_cast<double>(time_ns));
}

} // namespace okid_host
