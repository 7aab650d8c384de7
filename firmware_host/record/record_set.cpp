// SPDX-License-Identifier: MIT
// PURPOSE  counts of what is missing in measured records; means and lines taken out of them
#include "record_set.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace okid_host {
namespace {

bool is_complete(const double* row, std::size_t channels) {
    return std::none_of(row, row + channels, [](double x) { return std::isnan(x); });
}

/// Is every number there? In vectors: nearly always they all are.
bool is_whole(const double* x, std::size_t count) {
    using lanes = double __attribute__((vector_size(16)));
    using bits = std::int64_t __attribute__((vector_size(16)));
    bits missing = {};
    std::size_t i = 0;
    for (; i + 4 <= count; i += 4) {
        lanes v, w;
        std::memcpy(&v, x + i, sizeof v);
        std::memcpy(&w, x + i + 2, sizeof w);
        missing |= (v != v) | (w != w);
    }
    return !(missing[0] | missing[1]) && is_complete(x + i, count - i);
}

} // namespace

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
        if (is_whole(set.rows(record), record.count * set.channels())) continue;
        bool in_gap = false;
        const double* row = set.rows(record);
        for (std::size_t i = 0; i < record.count; ++i, row += set.channels()) {
            const bool gone = !is_complete(row, set.channels());
            out.samples += gone;
            out.gaps += gone && !in_gap;
            in_gap = gone;
        }
    }
    return out;
}

std::vector<long long> complete_runs(const record_set& set) {
    std::vector<long long> runs;
    for (const record_data& record : set.records) {
        long long run = 0;
        const double* row = set.rows(record);
        if (record.count > 0 && is_whole(row, record.count * set.channels())) {
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

void remove_means(record_set& set) {
    const std::size_t channels = set.channels();
    for (const record_data& record : set.records) {
        double* rows = set.rows(record);
        for (std::size_t k = 0; k < channels; ++k) {
            double sum = 0;
            std::size_t present = 0;
            for (std::size_t i = 0; i < record.count; ++i) {
                const double x = rows[i * channels + k];
                if (std::isnan(x)) continue;
                sum += x;
                ++present;
            }
            for (std::size_t i = 0; present && i < record.count; ++i)
                rows[i * channels + k] -= sum / static_cast<double>(present);
        }
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
