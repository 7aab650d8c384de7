// SPDX-License-Identifier: MIT
// PURPOSE  lanes whose frames have no counter: do the waiting frames show a loss, a slip of polls, or a busy computer?
// METHOD   compare how late each burst is with the line, and with the bursts before. A loss makes all later frames
//          late by the same; a busy computer makes them late by changing amounts; polls flicker before they slip
#include "grid.hpp"

#include "grid_bounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace okid_host {
namespace {

constexpr double about_one = 1.1; // periods: late by about one sample
constexpr std::size_t least_floors = 16, few_floors = 8;
constexpr double stands_out = 6;          // standard deviations
constexpr double now_and_then = 1.0 / 16; // share of the eighths of a decision time
constexpr double catching_up = 0.5;       // periods by which the newest frames are earlier than those before
constexpr double most_lost = 0.125;       // of the samples of a quarter of those that wait
constexpr std::int64_t many_steps = 8;    // bursts, each later than the one before
constexpr double ends_alike = 0.75;       // of the bursts have the size of the one before
constexpr double full_later = 0.5;        // periods by which a full burst is later than usual when a sample is missing
constexpr double one_step = 0.3;          // periods by which a sample and the step of lateness may differ
constexpr double alike_late = 0.3;        // periods
constexpr double least_spread = 0.15;     // periods
constexpr double sure = 13.8;             // -log of a chance of one in a million
constexpr double apart = 0.25;            // largest difference of shares between scatters that are alike
constexpr double slack = 0.2;             // periods that two scatters may differ by

} // namespace

/// Are all waiting frames late by more than chance explains, given how few bursts were so late before, and are the
/// newest steady? The lateness of a busy computer changes all the time; a missing sample does not come back.
/// @param more   periods by which they are later;  times: how often something was handed over
bool grid::shift_stays(const lane& l, double more, std::int64_t times, bool ended) const {
    const double known = l.known + 1;
    double in_time = 0.5;
    for (std::size_t k = 0; k < edges.size() && edges[k] <= more; ++k) in_time = l.share[k];
    const double seen = in_time * l.known, at_least = std::max(0.0, seen - 2 * std::sqrt(seen)); // so many by 2 sigma
    in_time = std::min(std::max(at_least, 0.5) / known, 1 - 0.5 / known);
    if (-static_cast<double>(times) * std::log1p(-in_time) < sure) return false;
    const std::int64_t begin_ns =
        l.late.back().time_ns - std::llround(newest * static_cast<double>(hold_) * period_ns_);
    std::int64_t bursts = 0;
    std::size_t begin = l.late.size();
    while (begin > l.placed && (l.late[begin - 1].time_ns >= begin_ns || bursts <= cut_off_bursts)) {
        --begin;
        bursts += begin == l.placed || !together(l, begin);
    }
    return steady(l, begin, l.late.size(), ended);
}

/// Is the lateness of these bursts, each beside the least late one behind it, no more scattered than before?
bool grid::steady(const lane& l, std::size_t begin, std::size_t end, bool ended) const {
    std::array<double, edges.size()> below{};
    double count = 0, least = HUGE_VAL;
    for (std::size_t i = end; i-- > begin;) {
        if (i + 1 == l.late.size() || together(l, i + 1)) continue;
        const double late = lateness(l, l.late[i], i - l.placed);
        least = std::min(least, late);
        for (std::size_t k = 0; k < edges.size(); ++k) below[k] += late < least + edges[k] + slack;
        ++count;
    }
    const double few = ended ? 0 : 1 / std::sqrt(count) + 1 / std::sqrt(l.known + 1), most_apart = std::max(apart, few);
    for (std::size_t k = 0; k < edges.size(); ++k)
        if (count > 0 && l.share[k] - below[k] / count > most_apart) return false;
    return true;
}

/// The oldest waiting frames are late by about a sample, and soon all are later still: the oldest were only late, and
/// the loss is behind them.
bool grid::only_late(const lane& l, bool ended) const {
    const std::int64_t begin_ns = l.late[l.placed].heard_ns, end_ns = l.late.back().heard_ns;
    const bool soon = ended || l.late[l.which].heard_ns < begin_ns + (end_ns - begin_ns) / 2;
    return soon && l.least < std::min(l.spread + least_spread, about_one);
}

/// The least lateness of the waiting frames, in each quarter of their time.
std::array<double, 4> grid::least_late(const lane& l) const {
    const std::int64_t begin_ns = l.late[l.placed].heard_ns, span_ns = l.late.back().heard_ns - begin_ns;
    std::array<double, 4> least{HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL}; // of each quarter
    for (std::size_t i = l.placed; i < l.late.size(); ++i) {
        const std::int64_t heard_ns = l.late[i].heard_ns - begin_ns;
        double& its =
            least[span_ns > 0 ? static_cast<std::size_t>(std::min<std::int64_t>(3, 4 * heard_ns / span_ns)) : 3];
        its = std::min(its, lateness(l, l.late[i], i - l.placed));
    }
    return least;
}

/// The frames are one sample less late than at first: polls slipped past a sample meanwhile, which may hide one of the
/// loss.
bool grid::in_two_steps(const lane& l) const {
    const std::array<double, 4> least = least_late(l);
    double most = l.least;
    for (const double quarter : least) most = quarter < HUGE_VAL ? std::max(most, quarter) : most;
    return std::abs(most - l.least - 1) < one_step;
}

/// The last quarter is less late than all before it, or lateness shrinks from quarter to quarter: the sender is making
/// up for a stall.
bool grid::catches_up(const lane& l) const {
    const std::array<double, 4> least = least_late(l);
    const bool less_and_less = least[3] < least[2] - catching_up && least[2] < least[1] - catching_up;
    return less_and_less || least[3] < std::min({least[0], least[1], least[2]}) - catching_up;
}

/// Lateness shrinks, or grows burst by burst by more than a line loses: the sender makes up for a stall, or is held up.
/// A loss is a single step, however long; losses before each of many bursts are rare.
bool grid::on_the_move(const lane& l) const {
    const std::array<double, 4> least = least_late(l);
    const double quarter = static_cast<double>(l.late.back().heard_ns - l.late[l.placed].heard_ns) / (4 * period_ns_);
    double after = HUGE_VAL; // the least of those that follow
    std::int64_t steps = 0, most_steps = 0;
    for (std::size_t i = l.late.size(); i-- > l.placed;) {
        if (i + 1 < l.late.size() && together(l, i + 1)) continue;
        const double its = std::min(after, lateness(l, l.late[i], i - l.placed));
        steps = after < HUGE_VAL && after - its > slack ? steps + 1 : 0;
        most_steps = std::max(most_steps, steps);
        after = its;
    }
    for (std::size_t k = 1; k < 3; ++k) {
        const double later = std::max(least[k], least[k + 1]) < HUGE_VAL ? least[k + 1] - least[k] : 0;
        if (std::abs(later) > 1 + most_lost * quarter && (later < 0 || most_steps >= many_steps)) return true;
    }
    return false;
}

/// The usual least lateness of a decision time. A clock that runs otherwise than the line delays all frames little by
/// little, a loss by a sample at once.
double grid::usually_late(const lane& l) const {
    const bool half = l.last - l.usual_from >= hold_ / 2 && l.usual[1] < HUGE_VAL;
    if (l.usual[0] < HUGE_VAL) return half ? std::max(l.usual[0], l.usual[1]) : l.usual[0];
    return half ? l.usual[1] : 0;
}

/// The last frame of a burst was late by l.tail_late. If all are later by a sample than in the decision time before,
/// though still on time, polls slipped past a sample or one is missing: uncertain.
void grid::note_lateness(lane& l, std::int64_t index) {
    if (index - l.usual_from >= hold_) {
        l.uncertain += l.usual[1] < HUGE_VAL && l.usual[1] - l.usual[0] > a_sample;
        l.usual = {l.usual[1], HUGE_VAL};
        l.usual_from = index;
    }
    if (l.tail_late > -most_early) l.usual[1] = std::min(l.usual[1], l.tail_late);
    if (index - l.floor_from >= floor_periods()) {
        if (l.floor_now < HUGE_VAL) l.floors[l.floor_count++ % l.floors.size()] = l.floor_now - l.moved;
        l.floor_now = HUGE_VAL;
        l.floor_from = index;
    }
    l.floor_now = std::min(l.floor_now, l.tail_late);
}

/// Busy: for whole eighths of the decision time nothing came in time, again and again, and not each of the newest eight
/// eighths had an arrival on the line.
bool grid::restless(const lane& l) const {
    const std::size_t known = std::min(l.floor_count, l.floors.size());
    bool calm = known >= few_floors; // now
    for (std::size_t k = 1; calm && k <= few_floors; ++k)
        calm = l.floors[(l.floor_count - k) % l.floors.size()] + l.moved < as_late;
    if (calm) return false;
    const auto late = std::count_if(l.floors.begin(), l.floors.begin() + static_cast<std::ptrdiff_t>(known),
                                    [&](double floor) { return floor + l.moved > about_one; });
    return static_cast<double>(late) > now_and_then * static_cast<double>(known) ||
           (known < least_floors && l.share[3] * l.known < ends_alike * (l.known + 2));
}

/// The step between two stretches of numbers with one slope (least squares), over its standard deviation. Newest first.
double grid::step_over_sigma(const std::vector<double>& values, std::size_t behind, double& by) {
    const std::size_t begin[] = {0, behind, values.size()};
    double mean[2] = {}, at[2] = {}, sxx = 0, sxy = 0, left = 0;
    for (std::size_t part = 0; part < 2; ++part) {
        const auto count = static_cast<double>(begin[part + 1] - begin[part]);
        for (std::size_t i = begin[part]; i < begin[part + 1]; ++i) mean[part] += values[i] / count;
        at[part] = 0.5 * static_cast<double>(begin[part] + begin[part + 1] - 1);
        for (std::size_t i = begin[part]; i < begin[part + 1]; ++i) {
            const double x = static_cast<double>(i) - at[part];
            sxx += x * x;
            sxy += x * (values[i] - mean[part]);
        }
    }
    const double slope = sxy / sxx, between = at[0] - at[1];
    for (std::size_t i = 0; i < values.size(); ++i) {
        const std::size_t part = i >= behind;
        const double residual = values[i] - mean[part] - slope * (static_cast<double>(i) - at[part]);
        left += residual * residual;
    }
    const double a = static_cast<double>(behind), b = static_cast<double>(values.size()) - a;
    by = mean[0] - mean[1] - slope * between;
    return by / (1e-9 + std::sqrt(left / (a + b - 3) * (1 / a + 1 / b + between * between / sxx)));
}

/// On a computer that is late all the time single bursts prove nothing: late ones follow late ones, and the line itself
/// is known badly. But the least lateness over some time (a floor) steps by a sample where one is missing. True if such
/// a step stands out of the residuals about a slope, for some length of that time.
/// @param by  out: the step, periods;  sigma: its standard deviation
bool grid::floors_apart(const lane& l, double& by, double& sigma) const {
    std::vector<double> floors, joined;
    const std::size_t known = std::min(l.floor_count, l.floors.size());
    for (std::size_t k = known; k > 0; --k) floors.push_back(l.floors[(l.floor_count - k) % l.floors.size()] + l.moved);
    const auto length = static_cast<std::size_t>(floor_periods());
    for (std::size_t from = l.placed; from + length <= l.late.size(); from += length) {
        double least = HUGE_VAL;
        for (std::size_t i = from; i < from + length; ++i)
            if (i + 1 == l.late.size() || !together(l, i + 1))
                least = std::min(least, lateness(l, l.late[i], i - l.placed));
        if (least < HUGE_VAL) floors.push_back(least);
    }
    double best = 0;
    for (std::size_t split = least_floors; split + least_floors <= floors.size(); split += few_floors) {
        double all = HUGE_VAL, shift = 0;
        for (std::size_t join = 1; join <= 8 && 4 * join <= floors.size() - split; join *= 2) {
            joined.clear();
            for (std::size_t end = floors.size(); end >= join; end -= join)
                joined.push_back(*std::min_element(floors.begin() + static_cast<std::ptrdiff_t>(end - join),
                                                   floors.begin() + static_cast<std::ptrdiff_t>(end)));
            all = std::min(all, step_over_sigma(joined, split / join, shift));
        }
        if (all > best) {
            best = all;
            by = shift;
            sigma = shift / all;
        }
    }
    return best > stands_out;
}

/// Did the waiting frames come in bursts that all end alike? Packets of a fixed size are not polls: the first one after
/// a loss is full, and later by what is missing.
/// @param times  out: number of bursts
bool grid::bursts_alike(const lane& l, std::int64_t& times) const {
    std::size_t begin = l.placed, before = 0, first = 0;
    std::int64_t same = 0, ends = 0, several = 0;
    times = 1;
    for (std::size_t i = l.placed + 1; i < l.late.size(); ++i) {
        if (together(l, i)) continue;
        same += before > 1 && i - begin == before;
        ends += lateness(l, l.late[i - 1], i - 1 - l.placed) < l.least + alike_late;
        before = i - begin;
        several += before > 1;
        if (times == 1) first = before;
        begin = i;
        ++times;
    }
    const auto most = static_cast<std::int64_t>(ends_alike * static_cast<double>(times - 2));
    if (times < cut_off_bursts || several <= most || std::max(same, ends) <= most) return false;
    const double bursts = static_cast<double>(times - 1), usual = static_cast<double>(begin - l.placed) / bursts;
    const auto first_ns = static_cast<double>(l.late[l.placed].time_ns);
    const double usual_ns = (static_cast<double>(l.late[begin].time_ns) - first_ns) / bursts;
    const double later = (first_ns - static_cast<double>(l.time_ns) - usual_ns) / period_ns_ - 1;
    return l.spread > as_late || std::abs(static_cast<double>(first) - usual) > full_later ||
           std::abs(later) > full_later;
}

/// The bus reported a loss no later than before this frame.
bool grid::loss_reported(const lane& l, std::size_t last) const {
    return std::any_of(l.late.begin() + static_cast<std::ptrdiff_t>(l.placed),
                       l.late.begin() + static_cast<std::ptrdiff_t>(last) + 1,
                       [](const late_frame& each) { return each.loss != 0; });
}

/// Bursts that all end alike came a period later: by drift polls slipped past a sample, or one sample is missing. The
/// arrivals look the same. Slips recur, but not soon after each other. A loss is rare, unless the bus reports it or the
/// lane has lost frames.
bool grid::may_slip(const lane& l) const {
    if (loss_reported(l, l.which)) return false;
    const std::int64_t silence = (l.late[l.placed].time_ns - l.time_ns) / std::llround(period_ns_);
    return l.last + silence - std::max(l.slip_at, l.lost_at) > slip_apart;
}

} // namespace okid_host
