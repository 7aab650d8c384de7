// SPDX-License-Identifier: MIT
// PURPOSE  the free decays in a record of unmeasured forces: trains over a bridge, steps, hits
// METHOD   the power in short blocks; a rise and a fall of 20 dB is an event, whatever is less belongs to it
#include "quiet_pieces.hpp"

#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double periods_of_block = 3; // of the frequency at which the outputs move on the whole
constexpr std::size_t samples_of_block = 16, blocks_of_piece = 4, fewest_pieces = 2;

/// Of each output its mean, what one unit of power is, and how many samples three periods are.
struct output_scales {
    std::vector<double> mean, unit;
    std::size_t block = 0;
};

output_scales scales_of_outputs(const record_set& set) {
    const std::size_t n = set.n_y;
    std::vector<double> count(n), steps(n), step(n);
    output_scales out{std::vector<double>(n), std::vector<double>(n), 0};
    for (std::size_t i = 0; i < set.samples.size(); ++i)
        if (const double y = set.samples[i]; y == y) out.mean[i % n] += y, ++count[i % n];
    for (std::size_t k = 0; k < n; ++k) out.mean[k] /= std::max(count[k], 1.0);
    for (const record_data& record : set.records) {
        const double* y = set.rows(record);
        for (std::size_t i = 0; i < record.count * n; ++i) {
            const double from = y[i] - out.mean[i % n], d = i < n ? NAN : y[i] - y[i - n];
            if (from == from) out.unit[i % n] += from * from;
            if (d == d) step[i % n] += d * d, ++steps[i % n];
        }
    }
    double moved = 0, all = 0;
    for (std::size_t k = 0; k < n; ++k) {
        out.unit[k] /= std::max(count[k], 1.0);
        if (!(out.unit[k] > 0) || steps[k] == 0) continue;
        moved += step[k] / steps[k] / out.unit[k] / 4; // sin(pi f)^2 of one frequency f
        ++all;
    }
    if (moved > 0)
        out.block = std::max(samples_of_block,
                             static_cast<std::size_t>(std::lround(periods_of_block * M_PI /
                                                                  std::asin(std::sqrt(std::min(moved / all, 1.0))))));
    return out;
}

/// The power of each block; of one without a sample, that of the block before.
std::vector<double> block_powers(const record_set& set, const record_data& record, const output_scales& by) {
    const std::size_t n = set.n_y, block = by.block * n;
    const double* y = set.rows(record);
    std::vector<double> out;
    for (std::size_t b = 0; (b + 1) * by.block <= record.count; ++b) {
        double sum = 0, count = 0;
        for (std::size_t i = b * block; i < (b + 1) * block; ++i) {
            const double from = y[i] - by.mean[i % n];
            if (from == from && by.unit[i % n] > 0) sum += from * from / by.unit[i % n], ++count;
        }
        out.push_back(count > 0 ? sum / count : out.empty() ? 0.0 : out.back());
    }
    return out;
}

/// Where an event was greatest, and where it is over: blocks.
struct power_fall {
    std::size_t peak, trough;
};

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
            out.push_back({peak, trough});
            falls = false;
            peak = b;
        }
    }
    if (falls) out.push_back({peak, power.size()});
    return out;
}

} // namespace

record_set after_events(const record_set& set) {
    record_set out;
    out.n_y = set.n_y;
    if (set.n_u > 0) return out;
    const output_scales by = scales_of_outputs(set);
    if (by.block == 0) return out;
    for (const record_data& record : set.records) {
        const std::vector<double> power = block_powers(set, record, by);
        for (const power_fall& one : falls_of(power)) {
            std::size_t first = one.peak, last = one.trough;
            for (std::size_t b = one.peak; b < last; ++b)
                if (power[b] * judgement::still_driven >= power[one.peak]) first = b + 1;
            if (last < first + blocks_of_piece) continue;
            const std::size_t end = last == power.size() ? record.count : last * by.block;
            out.add(record.path, set.rows(record) + first * by.block * set.n_y, end - first * by.block);
        }
    }
    return out.records.size() < fewest_pieces ? record_set{0, set.n_y, {}, {}, false} : out;
}

} // namespace okid_host
