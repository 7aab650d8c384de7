// SPDX-License-Identifier: MIT
// PURPOSE  multiplexed messages whose counter counts frames, not samples: all pages of a sample are one sample
// METHOD   the counter of each page rises by the same number from sample to sample; the least among the pages of a message
//          is its stride, if the stamps agree. The page with the lowest multiplexor value begins a sample
#include "grid.hpp"

#include "wrapped_step.hpp"

#include <algorithm>
#include <map>

namespace okid_host {
namespace {

constexpr std::int64_t least_steps = 3; // of a page, before its stride is believed
constexpr double too_slow = 0.75;       // of the rate: pages that come more rarely are not in every sample

/// What a page's frames tell: how often its counter rose by what.
struct page_steps {
    std::map<std::int64_t, std::int64_t> times;
    std::uint64_t first{}, newest{};
    std::int64_t first_ns{}, newest_ns{}, frames = 0, sum = 0, steps = 0;

    void add(std::uint64_t counter, std::int64_t time_ns, unsigned bits) {
        if (frames++ == 0) {
            first = newest = counter;
            first_ns = time_ns;
        }
        const std::int64_t step = wrapped_step(newest, counter, bits);
        newest = counter;
        newest_ns = time_ns;
        if (step <= 0) return;
        ++times[step];
        ++steps;
        sum += step;
    }
    /// The commonest step, 0 when none is.
    std::int64_t usual() const {
        const auto most = std::max_element(times.begin(), times.end(),
                                           [](const auto& a, const auto& b) { return a.second < b.second; });
        return most != times.end() && most->second >= least_steps && 2 * most->second > steps ? most->first : 0;
    }
    /// Does the counter rise by `stride` in a period, or faster (a log that is played fast)?
    bool fast_enough(std::int64_t stride, double period_ns) const {
        return static_cast<double>(sum) * period_ns >
               too_slow * static_cast<double>(stride) * static_cast<double>(newest_ns - first_ns);
    }
};

/// By how much the counter of these pages rises from sample to sample.
std::int64_t common_stride(const std::vector<page_steps>& seen, const std::vector<std::size_t>& pages,
                           double period_ns) {
    std::int64_t stride = 0;
    for (const std::size_t i : pages)
        if (const std::int64_t usual = seen[i].usual(); usual > 0 && (stride == 0 || usual < stride)) stride = usual;
    const bool fast =
        std::all_of(pages.begin(), pages.end(), [&](std::size_t i) { return seen[i].fast_enough(stride, period_ns); });
    return stride > 1 && fast ? stride : 1;
}

} // namespace

/// Steps of the lane's counter in samples.
std::int64_t grid::step_of(const lane& l, std::uint64_t from, std::uint64_t to) {
    const std::int64_t step = wrapped_step(from, to, l.sequence->length), half = l.stride / 2;
    return (step >= 0 ? step + half : step - half) / l.stride;
}

bool grid::one_message(const lane& a, const lane& b) { return a.bus == b.bus && a.key == b.key && a.mask == b.mask; }

/// By how many frames a page is behind the first one of its sample, by the counter of another page.
void grid::find_page(lane& l, std::uint64_t counter, const lane& beside, std::uint64_t its_counter) {
    const std::int64_t apart = wrapped_step(its_counter, counter, l.sequence->length) + beside.page;
    l.page = (apart % l.stride + l.stride) % l.stride;
}

/// Before the grid begins: the strides of all messages with pages. What is in every page is taken from the first one.
void grid::find_strides() {
    std::vector<page_steps> seen(lanes_.size());
    for (const auto& [which, frame] : held_) {
        const auto w = static_cast<std::size_t>(which);
        std::uint64_t counter{};
        if (lanes_[w].pages && read_counter(lanes_[w], frame, counter))
            seen[w].add(counter, frame.time_ns, lanes_[w].sequence->length);
    }
    for (std::size_t root = 0; root < lanes_.size(); ++root) {
        std::vector<std::size_t> pages;
        for (std::size_t i = 0; i < lanes_.size(); ++i)
            if (seen[i].frames > 0 && one_message(lanes_[i], lanes_[root])) pages.push_back(i);
        if (pages.empty() || pages.front() != root) continue;
        const std::int64_t stride = common_stride(seen, pages, period_ns_);
        if (stride == 1) continue;
        const std::size_t begins = *std::min_element(pages.begin(), pages.end(), [&](std::size_t a, std::size_t b) {
            return lanes_[a].selectors.back().values < lanes_[b].selectors.back().values;
        });
        for (lane& l : lanes_) {
            if ((!l.pages && !l.repeated) || !one_message(l, lanes_[root])) continue;
            l.stride = stride;
            l.page = l.repeated ? 0 : -1;
            if (l.repeated) l.selectors = lanes_[begins].selectors;
        }
        lanes_[begins].page = 0;
        for (const std::size_t i : pages) find_page(lanes_[i], seen[i].first, lanes_[begins], seen[begins].first);
    }
    held_.erase(std::remove_if(held_.begin(), held_.end(),
                               [&](const auto& held) {
                                   const lane& l = lanes_[static_cast<std::size_t>(held.first)];
                                   return l.repeated && !l.selectors.empty() && !l.selectors.back().holds(held.second);
                               }),
                held_.end());
}

} // namespace okid_host
