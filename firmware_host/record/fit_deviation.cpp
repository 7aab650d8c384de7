// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of modes that one event of the record tells of
// METHOD   a model without the block of the only hit knows nothing of a mode, and its distance from the whole says nothing. There
//          the deviation is that of a least-squares fit (Cramer-Rao): the record's motion q of each mode, its derivative d by the
//          pole, free shapes and D, so d counts less what these explain; the noise is what the model leaves, as it correlates
//          with d beside the mode's frequency (at the frequency itself the fit has left nothing). How far the middle one of the
//          runs is away comes on top
#include "fit_deviation.hpp"

#include "modal_answer.hpp"
#include "record_uncertainty.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t event_blocks = 20;                   // as a jackknife leaves out
constexpr std::array half_widths_away{2.0, 3.0, 4.0, 5.0}; // half-power half-widths from the frequency, on both sides
constexpr double silent = 1e-12;                           // of the largest power: what comes later adds nothing
constexpr Index gram_rows = 256;

/// The largest share of one block.
double largest_share(const std::vector<double>& of_block) {
    double sum = 0, largest = 0;
    for (const double one : of_block) sum += one, largest = std::max(largest, one);
    return sum > 0 ? largest / sum : 0;
}

/// Does an output have so much of its power in one block that a jackknife of its modes means little?
bool has_event(const record_set& set) {
    std::vector<std::vector<double>> power(set.n_y, std::vector<double>(event_blocks));
    for (std::size_t n = 0; n < set.count(); ++n)
        for (std::size_t o = 0; o < set.n_y; ++o)
            if (const double y = set.samples[n * set.channels() + set.n_u + o]; !std::isnan(y))
                power[o][n * event_blocks / set.count()] += y * y;
    return std::any_of(power.begin(), power.end(),
                       [](const auto& of_block) { return largest_share(of_block) > most_of_one_block; });
}

/// What a fit of the poles knows, summed over the records.
struct fit_sums {
    const record_work& work;
    std::vector<const listed_mode*> modes;
    MatrixXd gram;                             ///< of Re q, Im q of each mode, the forces, Re d, Im d of each mode
    std::vector<std::vector<double>> of_block; ///< energy of d, of each mode
    std::vector<double> energy;                ///< of d, of each mode
    std::vector<VectorXd> heard,
        noise; ///< of each mode and output: energy of d where it was measured, power of what is left

    Index linear() const { return static_cast<Index>(2 * modes.size() + work.set.n_u); }

    void add(std::size_t r) {
        const record_set& set = work.set;
        const answered_record record = answer(work, modes, r);
        const auto n_m = static_cast<Index>(modes.size()), n_u = static_cast<Index>(set.n_u);
        std::vector<std::vector<complex>> d;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            const complex mu = discrete_pole(*modes[k], work.model.dt);
            complex now = 0;
            auto& of_mode = d.emplace_back();
            for (std::size_t t = 0; t < record.count; ++t) {
                of_mode.push_back(now);
                of_block[k][(set.records[r].first + t) * event_blocks / set.count()] += std::norm(now);
                now = mu * (now + work.model.dt * record.states[k][t]);
            }
        }
        for (std::size_t k = 0; k < modes.size(); ++k) add_noise(record, d[k], k);
        MatrixXd rows(gram.rows(), gram_rows);
        for (std::size_t first = 0; first < record.count; first += gram_rows) {
            const Index count = std::min<Index>(gram_rows, static_cast<Index>(record.count - first));
            for (Index i = 0; i < count; ++i) {
                const std::size_t t = first + static_cast<std::size_t>(i);
                for (Index k = 0; k < n_m; ++k) {
                    const auto at = static_cast<std::size_t>(k);
                    rows(2 * k, i) = record.states[at][t].real();
                    rows(2 * k + 1, i) = record.states[at][t].imag();
                    rows(linear() + 2 * k, i) = d[at][t].real();
                    rows(linear() + 2 * k + 1, i) = d[at][t].imag();
                }
                const double* u = set.rows(set.records[r]) + t * set.channels();
                for (Index j = 0; j < n_u; ++j) rows(2 * n_m + j, i) = u[j];
            }
            gram.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(count));
        }
    }

    /// Correlation of what is left with d, turned beside the mode's frequency.
    void add_noise(const answered_record& record, const std::vector<complex>& d, std::size_t k) {
        const std::size_t n_y = work.set.n_y;
        const double half = 2 * M_PI * modes[k]->frequency_hz * modes[k]->damping_ratio * work.model.dt;
        double loudest = 0;
        for (const complex& one : d) energy[k] += std::norm(one), loudest = std::max(loudest, std::norm(one));
        std::size_t end = record.count;
        while (end > 0 && std::norm(d[end - 1]) <= silent * loudest) --end;
        for (std::size_t t = 0; t < end; ++t)
            for (std::size_t o = 0; o < n_y; ++o)
                if (!std::isnan(record.left[t * n_y + o])) heard[k][static_cast<Index>(o)] += std::norm(d[t]);
        for (const double away : half_widths_away)
            for (const double side : {-away, away}) {
                const complex step = std::polar(1.0, side * half);
                complex turn = 1;
                std::vector<complex> sum(n_y);
                for (std::size_t t = 0; t < end; ++t, turn *= step) {
                    const complex with = std::conj(d[t]) * turn;
                    for (std::size_t o = 0; o < n_y; ++o)
                        if (const double left = record.left[t * n_y + o]; !std::isnan(left)) sum[o] += with * left;
                }
                for (std::size_t o = 0; o < n_y; ++o)
                    noise[k][static_cast<Index>(o)] += std::norm(sum[o]) / (2.0 * half_widths_away.size());
            }
    }
};

/// Covariance of the real and imaginary part of the pole of mode k. @param free  Gram matrix of d less what is linear explains
Eigen::Matrix2d of_pole(const fit_sums& sums, const MatrixXd& free, std::size_t k) {
    const Index n = free.rows();
    MatrixXd known = MatrixXd::Zero(n, n), turn = MatrixXd::Zero(n, n);
    for (Index o = 0; o < sums.noise[k].size(); ++o) {
        for (std::size_t i = 0; i < sums.modes.size(); ++i) {
            const complex c = sums.modes[i]->shape[static_cast<std::size_t>(o)];
            const auto at = static_cast<Index>(2 * i);
            turn.block<2, 2>(at, at) << c.real(), -c.imag(), -c.imag(), -c.real(); // Re(c d (a + ib))
        }
        known += turn.transpose() * free * turn / sums.noise[k][o];
    }
    const VectorXd unit = known.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd inverse = (unit.asDiagonal() * known * unit.asDiagonal()).ldlt().solve(MatrixXd::Identity(n, n));
    const auto at = static_cast<Index>(2 * k);
    return unit.segment<2>(at).asDiagonal() * inverse.block<2, 2>(at, at) * unit.segment<2>(at).asDiagonal();
}

} // namespace

void deviations_by_fit(const std::vector<listed_mode>& listed, record_work& work) {
    result_context& context = work.context;
    if (work.set.n_u == 0 || !context.sigma || !context.x0 || context.refined || work.before) return;
    fit_sums sums{work, {}, {}, {}, {}, {}, {}};
    std::vector<std::size_t> place; // in the list, of a mode of the model
    bool missing = false;
    for (std::size_t i = 0; i < listed.size(); ++i) {
        if (!listed[i].in_model) continue;
        sums.modes.push_back(&listed[i]);
        place.push_back(i);
        missing = missing || std::isnan(context.sigma->frequency_hz[i]);
    }
    if (place.empty() || (!missing && !has_event(work.set))) return;
    const std::size_t n_y = work.set.n_y;
    const Index linear = sums.linear(), poles = static_cast<Index>(2 * place.size());
    sums.gram = MatrixXd::Zero(linear + poles, linear + poles);
    sums.of_block.assign(place.size(), std::vector<double>(event_blocks));
    sums.heard = sums.noise = std::vector<VectorXd>(place.size(), VectorXd::Zero(static_cast<Index>(n_y)));
    sums.energy.assign(place.size(), 0);
    for (std::size_t r = 0; r < work.set.records.size(); ++r) sums.add(r);
    const MatrixXd whole = sums.gram.selfadjointView<Eigen::Lower>();
    const VectorXd unit = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = unit.asDiagonal() * whole * unit.asDiagonal();
    const auto explained = scaled.topLeftCorner(linear, linear).ldlt();
    const MatrixXd across = scaled.topRightCorner(linear, poles);
    const VectorXd back = unit.tail(poles).cwiseInverse();
    const MatrixXd free = back.asDiagonal() *
                          (scaled.bottomRightCorner(poles, poles) - across.transpose() * explained.solve(across)) *
                          back.asDiagonal();
    const MatrixXd of_shapes = explained.solve(MatrixXd::Identity(linear, linear));
    for (std::size_t k = 0; k < place.size(); ++k) {
        const std::size_t i = place[k];
        if (!std::isnan(context.sigma->frequency_hz[i]) && largest_share(sums.of_block[k]) < most_of_one_block)
            continue;
        if (!(sums.heard[k].minCoeff() > 0) || !(sums.noise[k].minCoeff() > 0)) continue;
        sums.noise[k].array() *=
            sums.energy[k] / sums.heard[k].array().square(); // variance of a sample; all were measured
        const Eigen::Matrix2d pole = of_pole(sums, free, k);
        const double zeta = listed[i].damping_ratio, side = std::sqrt(1 - zeta * zeta),
                     omega = 2 * M_PI * listed[i].frequency_hz;
        const Eigen::Vector2d by_f = Eigen::Vector2d(-zeta, side) / (2 * M_PI),
                              by_zeta = -side * Eigen::Vector2d(side, zeta) / omega;
        const double f = by_f.dot(pole * by_f), damping = by_zeta.dot(pole * by_zeta);
        if (!(f > 0) || !(damping > 0) || !std::isfinite(f) || !std::isfinite(damping)) continue;
        context.sigma->frequency_hz[i] = std::hypot(std::sqrt(f), work.apart[i].first);
        context.sigma->damping_ratio[i] = std::hypot(std::sqrt(damping), work.apart[i].second);
        const auto at = static_cast<Index>(2 * k);
        const double of_entry =
            (of_shapes(at, at) * unit[at] * unit[at] + of_shapes(at + 1, at + 1) * unit[at + 1] * unit[at + 1]) / 2;
        std::size_t top = 0;
        for (std::size_t o = 1; o < n_y; ++o)
            if (std::abs(listed[i].shape[o]) > std::abs(listed[i].shape[top])) top = o;
        for (std::size_t o = 0; o < n_y; ++o) {
            const double here = sums.noise[k][static_cast<Index>(o)], there = sums.noise[k][static_cast<Index>(top)];
            const double entry = o == top ? 0 : std::sqrt(of_entry * (here + std::norm(listed[i].shape[o]) * there));
            context.sigma->shape_re[i * n_y + o] = context.sigma->shape_im[i * n_y + o] = entry;
        }
    }
}

} // namespace okid_host
