// SPDX-License-Identifier: MIT
// PURPOSE  the free decays in a record of unmeasured forces: trains over a bridge, steps, hits
// METHOD   the power in short blocks; a rise and a fall of 20 dB is an event, whatever is less belongs to it
#include "quiet_pieces.hpp"

#include "record_check.hpp"
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double periods_of_block = 3; // of the frequency at which the outputs move on the whole
constexpr std::size_t samples_of_block = 16, blocks_of_piece = 4;

/// Three periods in samples, of the one frequency whose steps from sample to sample have this size; 0: nothing moves.
std::size_t block_of(const record_set& set, const std::vector<output_spread>& about) {
    const std::size_t n = set.n_y;
    std::vector<double> steps(n), squares(n);
    for (const record_data& record : set.records) {
        const double* y = set.rows(record);
        for (std::size_t i = n; i < record.count * n; ++i)
            if (const double d = y[i] - y[i - n]; d == d) squares[i % n] += d * d, ++steps[i % n];
    }
    double moved = 0, outputs = 0;
    for (std::size_t k = 0; k < n; ++k) {
        if (!(about[k].squares > 0) || steps[k] == 0) continue;
        moved += squares[k] / steps[k] / (about[k].squares / about[k].count) / 4; // sin(pi f)^2
        ++outputs;
    }
    if (!(moved > 0)) return 0;
    const double periods = M_PI / std::asin(std::sqrt(std::min(moved / outputs, 1.0)));
    return std::max(samples_of_block, static_cast<std::size_t>(std::lround(periods_of_block * periods)));
}

/// The power of each block; of one without a sample, that of the block before.
std::vector<double> block_powers(const record_set& set, const record_data& record,
                                 const std::vector<output_spread>& about, std::size_t block) {
    const std::size_t n = set.n_y;
    const double* y = set.rows(record);
    std::vector<double> out;
    for (std::size_t b = 0; (b + 1) * block <= record.count; ++b) {
        double sum = 0, count = 0;
        for (std::size_t i = b * block * n; i < (b + 1) * block * n; ++i) {
            const output_spread& own = about[i % n];
            const double from = y[i] - own.mean;
            if (from == from && own.squares > 0) sum += from * from * own.count / own.squares, ++count;
        }
        out.push_back(count > 0 ? sum / count : out.empty() ? 0.0 : out.back());
    }
    return out;
}

/// Where an event was greatest, and where it is over: blocks.
struct power_fall {
    std::size_t peak, trough;
    bool is_over; ///< the power fell
};

/// Is the power of a block far above that of the one so many before it?
bool rises_at_once(const std::vector<double>& power, std::size_t to, std::size_t before) {
    return to >= before && power[to - before] * judgement::fall_of_power < power[to];
}

/// The last one may last beyond the end, if it rose at once.
std::vector<power_fall> falls_of(const std::vector<double>& power) {
    std::vector<power_fall> out;
    std::size_t peak = 0, trough = 0;
    bool falls = false;
    for (std::size_t b = 0; b < power.size(); ++b) {
        if (!falls) {
            if (power[b] > power[peak]) peak = b;
            falls = power[b] * judgement::fall_of_power < power[peak];
            trough = b;
        } else if (power[b] < power[trough]) {
            trough = b;
        } else if (power[b] > power[trough] * judgement::fall_of_power) {
            out.push_back({peak, trough, true});
            falls = false;
            peak = b;
        }
    }
    if (!power.empty() && (falls || rises_at_once(power, peak, 1) || rises_at_once(power, peak, 2)))
        out.push_back({peak, power.size(), falls});
    return out;
}

/// The first block in which nothing acts any more: where the power is a tenth; of a release that is all there is, at once.
std::size_t left_alone(const std::vector<double>& power, const power_fall& event, bool alone) {
    if (alone && rises_at_once(power, event.peak, 1)) return event.peak + 1;
    if (alone && rises_at_once(power, event.peak, 2)) return event.peak; // in the block before
    std::size_t first = event.peak;
    for (std::size_t b = event.peak; b < event.trough; ++b)
        if (power[b] * judgement::still_driven >= power[event.peak]) first = b + 1;
    return first;
}

} // namespace

record_set after_events(const record_set& set) {
    record_set out;
    out.n_y = set.n_y;
    if (set.n_u > 0) return out;
    const std::vector<output_spread> about = spreads_of(set);
    const std::size_t block = block_of(set, about);
    if (block == 0) return out;
    std::vector<std::vector<double>> powers;
    std::vector<std::vector<power_fall>> falls;
    std::size_t events = 0;
    for (const record_data& record : set.records) {
        powers.push_back(block_powers(set, record, about, block));
        falls.push_back(falls_of(powers.back()));
        events += falls.back().size();
    }
    for (std::size_t r = 0; r < powers.size(); ++r) {
        const record_data& record = set.records[r];
        for (const power_fall& one : falls[r]) {
            const std::size_t first = left_alone(powers[r], one, events == 1), last = one.trough;
            if (last < first + blocks_of_piece || (!one.is_over && events > 1)) continue;
            const std::size_t end = last == powers[r].size() ? record.count : last * block;
            out.add(record.path, set.rows(record) + first * block * set.n_y, end - first * block);
        }
    }
    return out;
}

std::pair<std::string, std::string> remark_pieces(const record_set& pieces, const record_set& all, double fs_hz,
                                                  double ratio, const std::vector<std::string>& alone) {
    const std::size_t n = pieces.records.size();
    const double seconds = static_cast<double>(pieces.count()) / fs_hz;
    const double of = static_cast<double>(all.count()) / fs_hz;
    const std::string times = n == 1 ? "once the power rises or falls" : fmt::format("{} times the power falls", n);
    const std::string what =
        n == 1 ? "is a free decay" : fmt::format("knows the modes {:.1f} times as well", 1 / ratio);
    const std::string others = alone.empty() ? "" : fmt::format(". Seen otherwise only: {}", fmt::join(alone, ", "));
    return {"free_decays", fmt::format("{} by 20 dB and more, as after {}. What follows, {:.0f} of "
                                       "{:.0f} s, {}: modes and fits are of that alone{}",
                                       times, n == 1 ? "a release" : "trains", seconds, of, what, others)};
}

} // namespace okid_host
