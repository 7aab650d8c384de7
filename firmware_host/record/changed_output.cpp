// SPDX-License-Identifier: MIT
// PURPOSE  a sensor that is turned over, comes loose or changes its range within a record
// METHOD   each output is fitted by the eight that move most like it, at three samples, in each eighth of the samples; how much of the
//          prediction it is in every other eighth has a step where it changes, and scatters little on both sides. The others have
//          steps too, since it is among those that predict them: it is the one without which none is left
#include "changed_output.hpp"

#include "files/order_statistics.hpp"
#include "result/judgement.hpp"
#include "stretch_means.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>
#include <vector>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index eighths = 8, predictors = 8, taps = 3; // regressors are `predictors` outputs at `taps` samples
constexpr std::size_t rows_of_eighth = 500;            // at least
constexpr std::size_t mean_reach = 50;                 // samples before and after, whose mean is taken off
constexpr std::size_t most_suspects = 8;               // outputs that are left out in turn
constexpr double slight_ridge = 1e-6;                  // of the mean square of the regressors
constexpr double no_slope = 0.05;                      // the reciprocal of less is none
constexpr double slope_scatter = 0.02;                 // of slopes, at least

struct slope_step {
    double size = 0, at = 0, factor = 1; ///< over the scatter of the slopes
};

/// Outputs of one record less their means over a hundred samples around; NaN stays.
MatrixXd quick_part(const record_set& set, const record_data& record) {
    const auto n = static_cast<Index>(set.n_y), count = static_cast<Index>(record.count);
    MatrixXd out(n, count);
    for (Index c = 0; c < n; ++c) {
        const double* y = set.rows(record) + set.n_u + static_cast<std::size_t>(c);
        const stretch_means means(y, set.channels(), record.count);
        for (std::size_t i = 0; i < record.count; ++i) {
            const std::size_t first = i - std::min(i, mean_reach), last = std::min(record.count, i + mean_reach + 1);
            out(c, static_cast<Index>(i)) = y[i * set.channels()] - means.of(first, last);
        }
    }
    return out;
}

/// Sums of products of all outputs at three samples, an eighth of the samples each; nothing where those are too short.
std::vector<MatrixXd> sums_of_eighths(const record_set& set) {
    const auto n = static_cast<Index>(set.n_y);
    std::vector<MatrixXd> sums(eighths, MatrixXd::Zero(taps * n, taps * n));
    std::vector<std::size_t> rows(eighths);
    VectorXd row(taps * n);
    std::size_t at = 0;
    for (const record_data& record : set.records) {
        const MatrixXd y = quick_part(set, record);
        for (Index i = 1; i + 1 < y.cols(); ++i) {
            row = y.middleCols(i - 1, taps).reshaped();
            const std::size_t eighth = (at + static_cast<std::size_t>(i)) * eighths / set.count();
            if (row.hasNaN()) continue;
            sums[eighth].selfadjointView<Eigen::Lower>().rankUpdate(row);
            ++rows[eighth];
        }
        at += record.count;
    }
    if (*std::min_element(rows.begin(), rows.end()) < rows_of_eighth) return {};
    VectorXd square = VectorXd::Zero(taps * n);
    for (MatrixXd& sum : sums) {
        sum.triangularView<Eigen::StrictlyUpper>() = sum.transpose();
        square += sum.diagonal();
    }
    const VectorXd unit = (square.array() > 0).select(square.cwiseSqrt().cwiseInverse(), 0.0);
    for (MatrixXd& sum : sums) sum = unit.asDiagonal() * sum * unit.asDiagonal();
    return sums;
}

/// The outputs that move most like this one.
std::vector<Index> most_alike(const MatrixXd& correlation, Index output, Index without) {
    const Index n = correlation.rows() / taps;
    std::vector<Index> out;
    for (Index c = 0; c < n; ++c)
        if (c != output && c != without) out.push_back(c);
    const auto alike = [&](Index c) { return std::abs(correlation(n + c, n + output)); };
    std::sort(out.begin(), out.end(),
              [&](Index a, Index b) { return std::pair(alike(b), a) < std::pair(alike(a), b); });
    out.resize(std::min(out.size(), static_cast<std::size_t>(predictors)));
    return out;
}

/// Row k, column l: how much of what eighth k predicts is there in eighth l.
MatrixXd slopes_between(const std::vector<MatrixXd>& sums, const MatrixXd& all, Index output, Index without) {
    const Index n = all.rows() / taps, own = n + output;
    std::vector<Index> others;
    for (const Index c : most_alike(all, output, without))
        for (Index lag = 0; lag < taps; ++lag) others.push_back(lag * n + c);
    MatrixXd out(eighths, eighths);
    for (Index k = 0; k < eighths; ++k) {
        MatrixXd own_block = sums[static_cast<std::size_t>(k)](others, others);
        own_block.diagonal().array() += slight_ridge * own_block.diagonal().mean();
        const VectorXd w = own_block.llt().solve(VectorXd(sums[static_cast<std::size_t>(k)](others, own)));
        for (Index l = 0; l < eighths; ++l) {
            const MatrixXd& sum = sums[static_cast<std::size_t>(l)];
            out(k, l) = w.dot(VectorXd(sum(others, own))) / w.dot(MatrixXd(sum(others, others)) * w);
        }
    }
    return out;
}

/// The largest step of the slopes: between two eighths, or within one, which is left out then.
slope_step largest_step(const MatrixXd& slopes) {
    slope_step out;
    if (!slopes.allFinite()) return out;                       // of an eighth in which nothing moves nothing is known
    for (Index twice = 2; twice <= 2 * eighths - 2; ++twice) { // the place of the step in half eighths
        const auto side = [&](Index k) { return 2 * k + 1 < twice ? -1 : 2 * k + 1 > twice ? 1 : 0; };
        std::vector<double> across, within;
        for (Index k = 0; k < eighths; ++k)
            for (Index l = 0; l < eighths; ++l) {
                const double slope = slopes(k, l);
                if (k == l || side(k) == 0 || side(l) == 0) continue;
                if (side(k) == side(l))
                    within.push_back(slope);
                else if (side(k) < 0)
                    across.push_back(slope);
                else
                    across.push_back(1 / (std::abs(slope) > no_slope ? slope : std::copysign(no_slope, slope)));
            }
        const double factor = upper_median(across);
        double square = 0; // of what one factor does not explain: of a step elsewhere all of it
        for (const double slope : within) square += (slope - 1) * (slope - 1);
        for (const double slope : across)
            square += (slope - factor) * (slope - factor) / std::max(1.0, factor * factor);
        const double scatter = std::sqrt(square / static_cast<double>(within.size() + across.size()));
        const double size = std::abs(factor - 1) / (scatter + slope_scatter);
        if (size > out.size) out = {size, static_cast<double>(twice) / 2 / eighths, factor};
    }
    return out;
}

} // namespace

std::optional<output_change> changed_output(const record_set& set) {
    if (set.n_u > 0 || set.n_y < 3) return std::nullopt;
    const std::vector<MatrixXd> sums = sums_of_eighths(set);
    if (sums.empty()) return std::nullopt;
    const auto n = static_cast<Index>(set.n_y);
    MatrixXd all = sums.front();
    for (std::size_t k = 1; k < sums.size(); ++k) all += sums[k];
    const auto steps = [&](Index without) {
        std::vector<slope_step> out;
        for (Index c = 0; c < n; ++c)
            out.push_back(c == without ? slope_step() : largest_step(slopes_between(sums, all, c, without)));
        return out;
    };
    const auto size_of = [](const std::vector<slope_step>& all_of) {
        double out = 0;
        for (const slope_step& one : all_of) out = std::max(out, one.size);
        return out;
    };
    const std::vector<slope_step> with_all = steps(-1);
    std::vector<Index> suspects; // the largest first
    for (Index c = 0; c < n; ++c) suspects.push_back(c);
    const auto size = [&](Index c) { return with_all[static_cast<std::size_t>(c)].size; };
    std::sort(suspects.begin(), suspects.end(),
              [&](Index a, Index b) { return std::pair(size(b), a) < std::pair(size(a), b); });
    const auto output = static_cast<std::size_t>(suspects.front());
    if (!(with_all[output].size > judgement::changed_step)) return std::nullopt;
    suspects.resize(std::min(suspects.size(), most_suspects));
    for (const Index c : suspects) // without the one that changed no step is left, without any other it is
        if ((size_of(steps(c)) < judgement::no_step) != (c == suspects.front())) return std::nullopt;
    return output_change{output, with_all[output].at, with_all[output].factor};
}

void remark_changed_output(const record_set& set, result_context& context) {
    const std::optional<output_change> change = changed_output(set);
    if (!change) return;
    context.warnings.emplace_back(
        "output_changed",
        fmt::format("{}: after some {:.0f} % of the record it is {:.2g} times what it was, as the other outputs say: a "
                    "sensor that turned or came loose, or another range. It spoils modes and shapes: leave it out "
                    "(--outputs), or keep one part (--range)",
                    context.outputs[change->output], 100 * change->at, change->factor));
}

} // namespace okid_host
