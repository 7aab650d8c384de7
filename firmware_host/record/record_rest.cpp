// SPDX-License-Identifier: MIT
#include "record_rest.hpp"

#include "files/order_statistics.hpp"
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double silence_share = 0.03; // of the spread after the hit
constexpr double begun = 0.05;         // of the largest force
constexpr std::size_t fewest_silent = 3;

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

bool begins_at_rest(const record_set& set, const record_data& record) {
    const std::size_t hit = onset(set, record);
    if (hit < fewest_silent || hit >= record.count) return false;
    const std::size_t last = std::min(record.count, hit + std::max<std::size_t>(64, (record.count - hit) / 10));
    for (std::size_t k = set.n_u; k < set.channels(); ++k)
        if (spread_within(set, record, k, 0, hit) > silence_share * spread_within(set, record, k, hit, last))
            return false;
    return true;
}

bool begin_at_rest(const record_set& set, const record_options& options) {
    return options.start == "rest" ||
           (set.n_u > 0 && std::all_of(set.records.begin(), set.records.end(),
                                       [&](const record_data& record) { return begins_at_rest(set, record); }));
}

} // namespace okid_host
