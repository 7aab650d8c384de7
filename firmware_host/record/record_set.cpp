// SPDX-License-Identifier: MIT
// PURPOSE  counts of what is missing in measured records; means and lines taken out of them
#include "record_set.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>

namespace okid_host {
namespace {

bool is_complete(const double* row, std::size_t channels) {
    return std::none_of(row, row + channels, [](double x) { return std::isnan(x); });
}

/// A record without a gap.
bool is_whole(const record_set& set, const record_data& record) {
    return set.complete || all_measured(set.rows(record), record.count * set.channels());
}

} // namespace

/// In vectors: nearly always they all are, and then so is the sum of their magnitudes.
bool all_measured(const double* x, std::size_t count) {
    using lanes = double __attribute__((vector_size(16)));
    using bits = std::uint64_t __attribute__((vector_size(16)));
    constexpr bits magnitude = {~(std::uint64_t{1} << 63), ~(std::uint64_t{1} << 63)};
    lanes sums[4] = {};
    std::size_t i = 0;
    for (; i + 8 <= count; i += 8)
#pragma GCC unroll 4
        for (std::size_t k = 0; k < 4; ++k) {
            bits v;
            std::memcpy(&v, x + i + 2 * k, sizeof v);
            v &= magnitude;
            lanes one;
            std::memcpy(&one, &v, sizeof one);
            sums[k] += one;
        }
    const lanes sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    const auto measured = [](double one) { return std::abs(one) < no_measured_value; };
    return std::all_of(measured(sum[0] + sum[1]) ? x + i : x, x + count, measured);
}

std::vector<std::vector<double>> record_set::rows_of_each() const {
    std::vector<std::vector<double>> out;
    for (const record_data& record : records) out.emplace_back(rows(record), rows(record) + record.count * channels());
    return out;
}

std::vector<double> record_set::outputs(const record_data& record, std::size_t begin, std::size_t end) const {
    std::vector<double> out;
    out.reserve((end - begin) * n_y);
    for (std::size_t i = begin; i < end; ++i) {
        const double* y = rows(record) + i * channels() + n_u;
        out.insert(out.end(), y, y + n_y);
    }
    return out;
}

void record_set::add(std::string path, const double* from, std::size_t rows) {
    records.push_back({std::move(path), count(), rows});
    samples.insert(samples.end(), from, from + rows * channels());
}

void record_set::add(std::string path, std::vector<double> rows, std::size_t begin, std::size_t end) {
    if (!samples.empty() || begin > 0) return add(std::move(path), rows.data() + begin * channels(), end - begin);
    rows.resize(end * channels());
    samples = std::move(rows);
    records.push_back({std::move(path), 0, end});
}

missing_count count_missing(const record_set& set) {
    missing_count out;
    for (const record_data& record : set.records) {
        if (is_whole(set, record)) continue;
        bool in_gap = false;
        const double* row = set.rows(record);
        for (std::size_t i = 0; i < record.count; ++i, row += set.channels()) {
            const bool gone = !is_complete(row, set.channels());
            const double* beyond = std::find_if(row, row + set.channels(), [](double one) {
                return std::isfinite(one) && std::abs(one) >= no_measured_value;
            });
            if (beyond != row + set.channels() && out.beyond == 0) {
                out.beyond = *beyond;
                out.beyond_record = static_cast<std::size_t>(&record - set.records.data());
                out.beyond_sample = i;
                out.beyond_channel = static_cast<std::size_t>(beyond - row);
            }
            out.samples += gone;
            out.gaps += gone && !in_gap;
            in_gap = gone;
        }
    }
    return out;
}

std::pair<std::string, std::string> missing_samples(const missing_count& missing, long long samples, bool bridged) {
    return {"missing_samples",
            fmt::format(
                "{} of {} samples are missing in {} gap{}: {}", missing.samples, samples, missing.gaps,
                missing.gaps == 1 ? "" : "s",
                bridged ? "short ones are bridged from the samples around them if they are a tenth of all at most, the "
                          "lags restart after the others"
                        : "left out, nothing was interpolated; the lags restart after each gap")};
}

std::vector<long long> complete_runs(const record_set& set) {
    std::vector<long long> runs;
    for (const record_data& record : set.records) {
        long long run = 0;
        const double* row = set.rows(record);
        if (record.count > 0 && is_whole(set, record)) {
            runs.push_back(static_cast<long long>(record.count));
            continue;
        }
        for (std::size_t i = 0; i < record.count; ++i, row += set.channels()) {
            if (is_complete(row, set.channels())) {
                ++run;
            } else if (run > 0) {
                runs.push_back(run);
                run = 0;
            }
        }
        if (run > 0) runs.push_back(run);
    }
    return runs;
}

namespace {

/// Sums over the samples of a complete record, in sums of 256: less rounding. `side` channels side by side.
template <std::size_t side> void take_means(double* rows, std::size_t channels, std::size_t count) {
    double mean[side] = {};
    for (std::size_t first = 0; first < count; first += 256) {
        double part[side] = {};
        const double *x = rows + first * channels, *last = rows + std::min(count, first + 256) * channels;
        for (; x < last; x += channels)
            for (std::size_t k = 0; k < side; ++k) part[k] += x[k];
        for (std::size_t k = 0; k < side; ++k) mean[k] += part[k];
    }
    for (double& one : mean) one /= static_cast<double>(count);
    for (double* x = rows; x < rows + count * channels; x += channels)
        for (std::size_t k = 0; k < side; ++k) x[k] -= mean[k];
}

/// The same over the samples of a channel that are there.
void take_mean(double* first, std::size_t channels, std::size_t count) {
    double sum = 0, present = 0;
    for (std::size_t from = 0; from < count; from += 256) {
        double part = 0;
        for (std::size_t i = from; i < std::min(count, from + 256); ++i) {
            const double x = first[i * channels];
            if (!std::isnan(x)) part += x, ++present;
        }
        sum += part;
    }
    const double mean = present > 0 ? sum / present : 0;
    for (std::size_t i = 0; i < count; ++i) first[i * channels] -= mean;
}

} // namespace

std::vector<double> means_of(const record_set& set) {
    std::vector<double> out(set.channels(), 0.0);
    for (const record_data& record : set.records)
        for (std::size_t k = 0; k < set.channels(); ++k) {
            double sum = 0, count = 0;
            for (std::size_t i = 0; i < record.count; ++i)
                if (const double x = set.rows(record)[i * set.channels() + k]; !std::isnan(x)) sum += x, ++count;
            if (count > 0) out[k] += sum / count / static_cast<double>(set.records.size());
        }
    return out;
}

void remove_means(record_set& set) {
    const std::size_t channels = set.channels();
    for (const record_data& record : set.records) {
        double* rows = set.rows(record);
        std::size_t k = 0;
        for (; set.complete && k + 8 <= channels; k += 8) take_means<8>(rows + k, channels, record.count);
        for (; set.complete && k + 4 <= channels; k += 4) take_means<4>(rows + k, channels, record.count);
        for (; set.complete && k < channels; ++k) take_means<1>(rows + k, channels, record.count);
        for (; k < channels; ++k) take_mean(rows + k, channels, record.count);
    }
}

void remove_lines(double* rows, std::size_t channels, std::size_t count) {
    const double middle = (static_cast<double>(count) - 1) / 2;
    for (std::size_t k = 0; k < channels; ++k) {
        double n = 0, st = 0, stt = 0, sx = 0, stx = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double x = rows[i * channels + k], t = static_cast<double>(i) - middle;
            if (std::isnan(x)) continue;
            n += 1, st += t, stt += t * t, sx += x, stx += t * x;
        }
        if (n == 0) continue;
        const double spread = stt - st * st / n;
        const double slope = spread > 0 ? (stx - st * sx / n) / spread : 0;
        const double level = (sx - slope * st) / n;
        for (std::size_t i = 0; i < count; ++i)
            rows[i * channels + k] -= level + slope * (static_cast<double>(i) - middle);
    }
}

} // namespace okid_host
