// SPDX-License-Identifier: MIT
// PURPOSE  how late a force is recorded
// METHOD   least squares of an output by 40 of its own samples before, and by the force from 40 samples before to k after: a force
//          that hits by surprise says nothing of an output before it. What is left for each k comes from one Cholesky factor,
//          whose columns are in that order, and falls by a step where the force that acts comes in. One or two samples after are
//          the precursor of a linear-phase filter
#include "late_force.hpp"

#include "gram_sum.hpp"
#include "record_rest.hpp"
#include "result/judgement.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <vector>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t lags_before = 40, most_late = 64, allowed_after = 2;
constexpr std::size_t most_rows = 20000, fewest_after_a_hit = 300;
constexpr std::size_t outputs_asked = 3;
constexpr double ridge_of_unit = 1e-10;

/// Samples about the hits, in order, `most` at most.
std::vector<std::size_t> about_hits(const std::vector<double>& force, std::size_t most) {
    std::vector<std::size_t> hits, out;
    if (force.size() <= lags_before + most_late) return out;
    const double pulse = level_of(force.data(), 1, force.size()).pulse;
    for (std::size_t i = 0, last = 0; i < force.size(); ++i) {
        if (!(std::abs(force[i]) > pulse)) continue;
        if (hits.empty() || i > last + most_late) hits.push_back(i);
        last = i;
    }
    const std::size_t each = hits.empty() ? 0 : std::max(fewest_after_a_hit, most / hits.size());
    std::size_t next = lags_before;
    for (const std::size_t hit : hits) {
        next = std::max(next, hit - std::min(hit, lags_before + most_late));
        for (; next < std::min(hit + each, force.size() - most_late) && out.size() < most; ++next) out.push_back(next);
    }
    return out;
}

/// Least squares of an output by itself before and by the force before and after.
class future_fit {
  public:
    void add(const std::vector<double>& force, const std::vector<double>& output,
             const std::vector<std::size_t>& samples) {
        for (const std::size_t n : samples) {
            auto x = sum_.next();
            Index at = 0;
            for (std::size_t back = 1; back <= lags_before; ++back) x[at++] = output[n - back];
            for (std::size_t i = n - lags_before; i <= n + most_late; ++i) x[at++] = force[i];
            x[at] = output[n];
            if (x.allFinite()) sum_.keep();
        }
        sum_.fold();
    }

    /// Logarithm of the power that is left with the force up to 0, 1 … samples after; empty: nothing tells.
    std::vector<double> left() const {
        if (sum_.kept() < samples_per_number * numbers) return {};
        MatrixXd scaled = scaled_matrix(sum_.values()).values;
        scaled.diagonal().array() += ridge_of_unit;
        const MatrixXd factor = scaled.llt().matrixL();
        std::vector<double> out(most_late + 1);
        double sum = 0;
        for (std::size_t k = most_late + 1; k-- > 0;) {
            sum += std::pow(factor(numbers - 1, static_cast<Index>(2 * lags_before + 1 + k)), 2);
            out[k] = std::log(sum);
        }
        return out;
    }

  private:
    static constexpr Index numbers = 2 * lags_before + 2 + most_late; // of the regression, the output last
    static constexpr Index samples_per_number = 4;

    gram_sum sum_{numbers};
};

/// The largest step down; 0: none that says that the force is late.
std::size_t step_down(const std::vector<double>& left) {
    if (left.empty()) return 0;
    std::size_t step = allowed_after + 1;
    for (std::size_t k = step + 1; k <= most_late; ++k)
        if (left[k - 1] - left[k] > left[step - 1] - left[step]) step = k;
    return left[step - 1] - left[step] > std::log(judgement::answered_before) ? step : 0;
}

} // namespace

std::size_t samples_late(const record_set& set) {
    if (set.n_u != 1) return 0;
    std::vector<future_fit> fits(std::min(set.n_y, outputs_asked));
    for (const record_data& record : set.records) {
        const std::vector<double> force = from_rest(set, record, 0);
        if (!acts_in_hits(force)) return 0;
        const std::vector<std::size_t> samples = about_hits(force, most_rows / set.records.size());
        for (std::size_t i = 0; i < fits.size(); ++i)
            fits[i].add(force, from_rest(set, record, 1 + i * set.n_y / fits.size()), samples);
    }
    std::size_t speak = 0;
    std::vector<double> together(most_late + 1);
    for (const future_fit& fit : fits) {
        const std::vector<double> left = fit.left();
        if (step_down(left) == 0) continue;
        ++speak;
        for (std::size_t k = 0; k <= most_late; ++k) together[k] += left[k];
    }
    return 2 * speak < fits.size() ? 0 : step_down(together);
}

void bring_force_forward(record_set& set, double fs_hz, remarks& said) {
    const std::size_t late = samples_late(set);
    if (late == 0) return;
    for (const record_data& record : set.records) {
        double* const force = set.rows(record);
        for (std::size_t i = 0; i < record.count; ++i)
            force[i * set.channels()] = force[std::min(i + late, record.count - 1) * set.channels()];
    }
    said.emplace_back(
        "late_force",
        fmt::format("the outputs answer hits before the force shows them: it is recorded {} samples ({:.3g} ms) "
                    "late, and taken as so much earlier. Look for a filter, a logger or a clock of its own",
                    late, 1e3 * static_cast<double>(late) / fs_hz));
}

} // namespace okid_host
