// SPDX-License-Identifier: MIT
#include "record_rest.hpp"

#include "files/order_statistics.hpp"
#include "stretch_means.hpp"
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

namespace okid_host {
namespace {

constexpr double silence_share = 0.03; // of the spread after the hit
constexpr double begun = 0.05;         // of the largest force
constexpr std::size_t fewest_silent = 3;
constexpr double struck_share = 0.1;       // of the largest force
constexpr std::size_t resting_share = 20;  // a force beyond that in more than one of so many samples does not rest
constexpr double of_one_sign = 0.5;        // of a hit's sum of magnitudes, its sum; a burst of noise has none
constexpr double audible = 5;              // of the usual distance from rest: above, a force acts
constexpr std::size_t about_a_hit = 4;     // samples, or as many as the longest hit has
constexpr std::size_t hits_of_a_mean = 16; // times as long: means at rest, of a channel that comes back slowly
constexpr double heard_in_a_mean = 6;      // deviations of such a mean

/// Spread of a channel over samples first .. last-1 of a record.
double spread_within(const record_set& set, const record_data& record, std::size_t channel, std::size_t first,
                     std::size_t last) {
    const double* rows = set.rows(record);
    double sum = 0, square = 0, count = 0;
    for (std::size_t i = first; i < last; ++i)
        if (const double x = rows[i * set.channels() + channel]; !std::isnan(x)) sum += x, square += x * x, ++count;
    return count > 0 ? std::sqrt(std::max(0.0, square / count - sum * sum / count / count)) : 0;
}

double middle_of(const record_set& set, const record_data& record, std::size_t channel) {
    std::vector<double> values;
    const double* rows = set.rows(record);
    for (std::size_t i = 0; i < record.count; ++i)
        if (const double x = rows[i * set.channels() + channel]; !std::isnan(x)) values.push_back(x);
    return values.empty() ? 0 : upper_median(values);
}

/// Samples of a force that differ from rest by more than `least`, in stretches.
std::vector<std::pair<std::size_t, std::size_t>> stretches_beyond(const std::vector<double>& force, double least) {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t i = 0; i < force.size(); ++i) {
        if (!(std::abs(force[i]) > least)) continue;
        if (out.empty() || out.back().second < i) out.emplace_back(i, i);
        out.back().second = i + 1;
    }
    return out;
}

/// Is a sample in such a stretch, or as near as `reach` to one?
std::vector<bool> around_stretches(const std::vector<double>& force, double least, std::size_t reach) {
    std::vector<bool> out(force.size());
    for (const auto& [first, end] : stretches_beyond(force, least))
        std::fill(out.begin() + static_cast<std::ptrdiff_t>(first - std::min(first, reach)),
                  out.begin() + static_cast<std::ptrdiff_t>(std::min(force.size(), end + reach)), true);
    return out;
}

/// A force that acts in hits alone; `acts` is empty: it does not.
struct hit_force {
    std::vector<bool> acts;
    std::size_t longest = about_a_hit; ///< hit
    double usual = 0;                  ///< distance from rest
};

/// @param force  less what it rests at, NaN: missing
hit_force hits_of(const std::vector<double>& force) {
    hit_force out;
    const force_level level = level_of(force.data(), 1, force.size());
    std::vector<double> known;
    std::copy_if(force.begin(), force.end(), std::back_inserter(known), [](double x) { return !std::isnan(x); });
    out.usual = usual_distance(std::move(known), 0);
    if (!level.rests || !(level.pulse > audible * out.usual)) return out;
    for (const auto& [first, end] : stretches_beyond(force, level.pulse)) {
        double sum = 0, all = 0;
        for (std::size_t i = first; i < end; ++i) sum += force[i], all += std::abs(force[i]);
        if (std::abs(sum) < of_one_sign * all) return out;
        out.longest = std::max(out.longest, end - first);
    }
    out.acts = around_stretches(force, audible * out.usual, out.longest);
    return out;
}

/// Where a force that acts in hits alone changes; a channel that comes back slowly says nothing of the force. Empty: it acts otherwise.
std::vector<bool> struck_within(const std::vector<double>& force) {
    const hit_force hits = hits_of(force);
    if (hits.acts.empty()) return {};
    std::vector<double> steps(force.size()), known;
    for (std::size_t i = 1; i < force.size(); ++i) steps[i] = force[i] - force[i - 1];
    std::copy_if(steps.begin(), steps.end(), std::back_inserter(known), [](double x) { return !std::isnan(x); });
    return around_stretches(steps, audible * usual_distance(std::move(known), 0), hits.longest);
}

/// The force without its noise at rest: means over many samples that stand out of it, as behind a channel that has no reach to zero
/// frequency and comes back slowly; else nothing.
std::vector<double> without_noise(const std::vector<double>& force, const hit_force& hits) {
    std::vector<double> out = force;
    const stretch_means means(force.data(), 1, force.size());
    const std::size_t reach = hits_of_a_mean * hits.longest / 2;
    for (std::size_t first = 0, end = 0; first < force.size(); first = end + 1) {
        for (end = first; end < force.size() && !hits.acts[end];) ++end;
        for (std::size_t i = first; i < end; ++i) {
            if (std::isnan(force[i])) continue;
            const std::size_t from = i < first + reach ? first : i - reach, to = std::min(end, i + reach + 1);
            const double mean = means.of(from, to);
            out[i] = std::abs(mean) > heard_in_a_mean * hits.usual / std::sqrt(means.known(from, to)) ? mean : 0;
        }
    }
    return out;
}

/// The sample at which the force of a record sets in.
std::size_t onset(const record_set& set, const record_data& record) {
    std::size_t first = record.count;
    const double* rows = set.rows(record);
    for (std::size_t k = 0; k < set.n_u; ++k) {
        const double rest = middle_of(set, record, k);
        const auto away = [&](std::size_t i) { return std::abs(rows[i * set.channels() + k] - rest); };
        double largest = 0;
        for (std::size_t i = 0; i < record.count; ++i) largest = std::fmax(largest, away(i));
        for (std::size_t i = 0; i < first; ++i)
            if (away(i) > begun * largest) first = i;
    }
    return first;
}

} // namespace

force_level level_of(const double* force, std::size_t stride, std::size_t count) {
    double largest = 0;
    for (std::size_t i = 0; i < count; ++i) largest = std::fmax(largest, std::abs(force[i * stride]));
    force_level out{struck_share * largest};
    std::size_t beyond = 0;
    for (std::size_t i = 0; i < count; ++i) beyond += std::abs(force[i * stride]) > out.pulse;
    out.rests = beyond * resting_share <= count;
    return out;
}

std::vector<double> from_rest(const record_set& set, const record_data& record, std::size_t channel) {
    const double rest = middle_of(set, record, channel);
    std::vector<double> out(record.count);
    for (std::size_t i = 0; i < record.count; ++i) out[i] = set.rows(record)[i * set.channels() + channel] - rest;
    return out;
}

bool acts_in_hits(const std::vector<double>& force) { return !hits_of(force).acts.empty(); }

bool begins_at_rest(const record_set& set, const record_data& record) {
    const std::size_t hit = onset(set, record);
    if (hit < fewest_silent || hit >= record.count) return false;
    const std::size_t last = std::min(record.count, hit + std::max<std::size_t>(64, (record.count - hit) / 10));
    for (std::size_t k = set.n_u; k < set.channels(); ++k)
        if (spread_within(set, record, k, 0, hit) > silence_share * spread_within(set, record, k, hit, last))
            return false;
    return true;
}

bool rest_between_hits(record_set& set) {
    bool changed = false;
    for (const record_data& record : set.records)
        for (std::size_t k = 0; k < set.n_u; ++k) {
            double* const column = set.rows(record) + k;
            const double rest = middle_of(set, record, k);
            const std::vector<double> force = from_rest(set, record, k);
            const hit_force hits = hits_of(force);
            if (hits.acts.empty()) continue;
            const std::vector<double> still = without_noise(force, hits);
            for (std::size_t i = 0; i < force.size(); ++i)
                if (std::abs(force[i] - still[i]) > 0) column[i * set.channels()] = rest + still[i], changed = true;
        }
    return changed;
}

record_set after_hits(const record_set& set) {
    record_set out;
    out.n_y = set.n_y;
    for (const record_data& record : set.records) {
        std::vector<bool> acts(record.count);
        for (std::size_t k = 0; k < set.n_u; ++k) {
            const std::vector<bool> own = struck_within(from_rest(set, record, k));
            if (own.empty()) return {};
            for (std::size_t i = 0; i < record.count; ++i) acts[i] = acts[i] || own[i];
        }
        for (auto end = acts.begin(); end != acts.end();) {
            const auto first = std::find(std::find(end, acts.end(), true), acts.end(), false);
            end = std::find(first, acts.end(), true);
            const auto begin = static_cast<std::size_t>(first - acts.begin()),
                       last = static_cast<std::size_t>(end - acts.begin());
            if (begin < last) out.add(record.path, set.outputs(record, begin, last).data(), last - begin);
        }
    }
    return out;
}

bool begin_at_rest(const record_set& set, const record_options& options) {
    return options.start == "rest" ||
           (set.n_u > 0 && std::all_of(set.records.begin(), set.records.end(),
                                       [&](const record_data& record) { return begins_at_rest(set, record); }));
}

} // namespace okid_host
