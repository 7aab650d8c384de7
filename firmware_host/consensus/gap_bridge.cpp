// SPDX-License-Identifier: MIT
// PURPOSE  short gaps bridged: each would cost all rows that look back on it
// METHOD   the mean of the missing samples given the others of a window of rows, for a Gaussian process that has the covariances
//          of the records: x_M = -Q_MM^-1 Q_MO x_O with Q the inverse of the covariance matrix (linear prediction of all channels
//          from both sides). Its errors are uncorrelated with what it puts in: they add noise, and no bias
#include "gap_bridge.hpp"

#include "owned_sums.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t rows_of_gap = 4; // of a window, to each row of the longest gap
constexpr std::size_t longest_window = rows_of_gap * longest_bridged, shortest_window = 4; // rows
constexpr std::size_t most_of_window = 400;                                                // numbers
constexpr double most_missing = 0.1;                                                       // of the rows, in short gaps
constexpr double least_power = 1e-9; // of the power of a channel, added to it

bool is_missing(const double* row, std::size_t m) {
    return std::any_of(row, row + m, [](double x) { return std::isnan(x); });
}

/// use(first, last) for each run of rows in which a channel is missing.
template <class Use> void each_gap(const sample_rows& rows, std::size_t m, Use&& use) {
    const std::size_t count = rows.size() / m;
    for (std::size_t first = 0; first < count; ++first) {
        if (!is_missing(&rows[first * m], m)) continue;
        std::size_t last = first;
        while (last < count && is_missing(&rows[last * m], m)) ++last;
        use(first, last);
        first = last;
    }
}

/// Inverse of the covariances of a window of rows, its last row first, and of each channel one over its size.
struct window_law {
    std::size_t rows = 0; ///< 0: too few samples without gaps
    VectorXd scale;
    MatrixXd inverse;

    window_law(const std::vector<sample_rows>& records, std::size_t m) {
        for (std::size_t wanted = std::clamp(most_of_window / m, shortest_window, longest_window);
             wanted >= shortest_window; wanted /= 2)
            if (take(records, m, wanted)) return;
    }

  private:
    bool take(const std::vector<sample_rows>& records, std::size_t m, std::size_t wanted) {
        okid_accumulator_config_t config =
            okid_accumulator_defaults(0, static_cast<int>(m), static_cast<int>(wanted) - 1);
        config.edges = 1;
        const owned_sums sums(config);
        if (!sums.sums) return false;
        for (const sample_rows& record : records) {
            okid_accumulator_gap(sums.sums, 0);
            if (okid_accumulator_add(sums.sums, record.data(), record.size() / m) < 0) return false;
        }
        const auto size = static_cast<Index>(wanted * m), channels = static_cast<Index>(m);
        if (okid_accumulator_rows(sums.sums) < 4 * size) return false;
        MatrixXd gram(size, size);
        if (okid_accumulator_gram(sums.sums, OKID_DETREND_NONE, gram.data(), nullptr) < 0) return false;
        scale = gram.diagonal().head(channels).unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 1.0; });
        const VectorXd all = scale.replicate(static_cast<Index>(wanted), 1);
        gram = all.asDiagonal() * gram * all.asDiagonal();
        gram.diagonal().array() += least_power;
        const Eigen::LLT<MatrixXd> factor(gram);
        if (factor.info() != Eigen::Success) return false;
        inverse = factor.solve(MatrixXd::Identity(size, size));
        rows = wanted;
        return true;
    }
};

/// Rows first .. last-1 of `out` from the window of `rows` around them.
void fill(const window_law& law, const sample_rows& rows, std::size_t m, std::size_t first, std::size_t last,
          sample_rows& out) {
    const std::size_t count = rows.size() / m, middle = (first + last) / 2;
    const std::size_t begin = std::min(middle - std::min(middle, law.rows / 2), count - law.rows);
    std::vector<Index> unknown;
    VectorXd known = VectorXd::Zero(law.inverse.rows());
    const auto place = [&](std::size_t t, std::size_t c) { // the last row is the first of the law
        return static_cast<Index>((begin + law.rows - 1 - t) * m + c);
    };
    for (std::size_t t = begin; t < begin + law.rows; ++t)
        for (std::size_t c = 0; c < m; ++c) {
            const double x = rows[t * m + c];
            if (std::isnan(x))
                unknown.push_back(place(t, c));
            else
                known[place(t, c)] = x * law.scale[static_cast<Index>(c)];
        }
    if (2 * unknown.size() > law.rows * m) return;
    const auto n = static_cast<Index>(unknown.size());
    MatrixXd inside(n, n);
    VectorXd right(n);
    for (Index i = 0; i < n; ++i) {
        const Index of = unknown[static_cast<std::size_t>(i)];
        right[i] = -law.inverse.col(of).dot(known);
        for (Index j = 0; j < n; ++j) inside(i, j) = law.inverse(of, unknown[static_cast<std::size_t>(j)]);
    }
    const VectorXd found = inside.llt().solve(right);
    for (Index i = 0; i < n; ++i) {
        const auto at = static_cast<std::size_t>(unknown[static_cast<std::size_t>(i)]);
        const std::size_t t = begin + law.rows - 1 - at / m, c = at % m;
        if (t >= first && t < last) out[t * m + c] = found[i] / law.scale[static_cast<Index>(c)];
    }
}

} // namespace

std::vector<sample_rows> bridge_gaps(const std::vector<sample_rows>& records, std::size_t m) {
    std::size_t all = 0, missing = 0;
    for (const sample_rows& rows : records) {
        all += rows.size() / m;
        each_gap(rows, m, [&](std::size_t first, std::size_t last) {
            if (rows_of_gap * (last - first) <= longest_window) missing += last - first;
        });
    }
    if (missing == 0 || static_cast<double>(missing) > most_missing * static_cast<double>(all)) return {};
    const window_law law(records, m);
    if (law.rows == 0) return {};
    std::vector<sample_rows> out = records;
    for (std::size_t r = 0; r < records.size(); ++r)
        each_gap(records[r], m, [&](std::size_t first, std::size_t last) {
            if (rows_of_gap * (last - first) <= law.rows && records[r].size() / m >= law.rows)
                fill(law, records[r], m, first, last, out[r]);
        });
    return out;
}

} // namespace okid_host
