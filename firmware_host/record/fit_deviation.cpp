// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of modes that one event of the record tells of
// METHOD   a model without the block of the only hit knows nothing of a mode: that it stands elsewhere means nothing. The deviation
//          is then that of a least-squares fit (Cramer-Rao bound). Its regressors are the motion q of each mode, whose factors are
//          the shapes, the forces, whose factor is D, and d, the derivative of q by the pole. The noise is what the model leaves,
//          correlated with d beside the mode's frequency; at the frequency itself the fit has left nothing. There the noise is
//          larger where it shakes the structure as traffic does: a + b / (1 + x^2) at x half-widths from the frequency, a and b
//          from what is left near to it and far from it. The median distance of the runs from the values is added, as a root of
//          squares
#include "fit_deviation.hpp"

#include "gram_sum.hpp"
#include "modal_answer.hpp"
#include "record_uncertainty.hpp"
#include "result/judgement.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t event_blocks = 20; // as a jackknife leaves out
// half-power half-widths from the frequency, on both sides
constexpr std::array near_lines{1.5, 2.5, 3.5}, far_lines{5.0, 7.0, 9.0};
constexpr double shaken_share = 0.75; // of b in the pole's noise: (1 + x^2)^-3 over (1 + x^2)^-2, integrals over x
constexpr double near_over_far = 0.6; // deviation of near over far of one output, where b is 0: 6 lines each
constexpr double silent = 1e-12;      // of the largest power: what comes later adds nothing

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

/// Mean of 1 / (1 + x^2).
double shaken_at(const std::array<double, 3>& half_widths) {
    double sum = 0;
    for (const double x : half_widths) sum += 1 / (1 + x * x);
    return sum / half_widths.size();
}

/// What is left beside a mode, of each output, summed over so many records.
struct left_beside {
    VectorXd near_it, far_from_it;
    double records = 0;

    /// Power at the mode. How much of it the structure amplifies is the same for all outputs.
    VectorXd at_the_mode() const {
        const double by_near = shaken_at(near_lines), by_far = shaken_at(far_lines);
        const double ratio = (near_it.array() / far_from_it.array().max(1e-300)).mean(),
                     by_chance = near_over_far / std::sqrt(records * static_cast<double>(near_it.size()));
        const double b = std::max(0.0, ratio - 1 - by_chance) / (by_near - by_far); // over what is far from it
        return (near_it + far_from_it) / 2 + (shaken_share - (by_near + by_far) / 2) * b * far_from_it;
    }
};

/// What a fit of shapes, D and poles knows, summed over the records.
struct fit_sums {
    const record_work& work;
    std::vector<const listed_mode*> modes;
    gram_sum gram;                             ///< of Re q, Im q of each mode, the forces, Re d, Im d of each mode
    std::vector<std::vector<double>> of_block; ///< energy of d, of each mode
    std::vector<VectorXd> heard;               ///< of each mode and output: energy of d where it was measured
    std::vector<left_beside> left;             ///< of each mode

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
        for (std::size_t t = 0; t < record.count; ++t) {
            auto x = gram.next();
            for (Index k = 0; k < n_m; ++k) {
                const auto at = static_cast<std::size_t>(k);
                x[2 * k] = record.states[at][t].real();
                x[2 * k + 1] = record.states[at][t].imag();
                x[linear() + 2 * k] = d[at][t].real();
                x[linear() + 2 * k + 1] = d[at][t].imag();
            }
            const double* u = set.rows(set.records[r]) + t * set.channels();
            for (Index j = 0; j < n_u; ++j) x[2 * n_m + j] = u[j];
            gram.keep();
        }
        gram.fold();
    }

    /// Correlations of what is left with d, turned beside the mode's frequency.
    void add_noise(const answered_record& record, const std::vector<complex>& d, std::size_t k) {
        const std::size_t n_y = work.set.n_y;
        const double half = 2 * M_PI * modes[k]->frequency_hz * modes[k]->damping_ratio * work.model.dt;
        double loudest = 0;
        for (const complex& one : d) loudest = std::max(loudest, std::norm(one));
        std::size_t end = record.count;
        while (end > 0 && std::norm(d[end - 1]) <= silent * loudest) --end;
        for (std::size_t t = 0; t < end; ++t)
            for (std::size_t o = 0; o < n_y; ++o)
                if (!std::isnan(record.left[t * n_y + o])) heard[k][static_cast<Index>(o)] += std::norm(d[t]);
        add_left(record, d, end, half, near_lines, left[k].near_it);
        add_left(record, d, end, half, far_lines, left[k].far_from_it);
        ++left[k].records;
    }

    void add_left(const answered_record& record, const std::vector<complex>& d, std::size_t end, double half,
                  const std::array<double, 3>& half_widths, VectorXd& power) const {
        const std::size_t n_y = work.set.n_y;
        for (const double away : half_widths)
            for (const double side : {-away, away}) {
                const complex step = std::polar(1.0, side * half);
                complex turn = 1;
                std::vector<complex> sum(n_y);
                for (std::size_t t = 0; t < end; ++t, turn *= step) {
                    const complex with = std::conj(d[t]) * turn;
                    for (std::size_t o = 0; o < n_y; ++o)
                        if (const double y = record.left[t * n_y + o]; !std::isnan(y)) sum[o] += with * y;
                }
                for (std::size_t o = 0; o < n_y; ++o)
                    power[static_cast<Index>(o)] += std::norm(sum[o]) / (2.0 * half_widths.size());
            }
    }
};

/// The Gram matrix of d less what shapes and D explain of it, and the inverse of theirs.
struct fit_information {
    MatrixXd of_poles;
    VectorXd of_shapes; ///< its diagonal

    explicit fit_information(const fit_sums& sums) {
        const scaled_matrix gram(sums.gram.values());
        const Index linear = sums.linear(), poles = gram.size.size() - linear;
        const auto explained = gram.values.topLeftCorner(linear, linear).ldlt();
        const MatrixXd across = gram.values.topRightCorner(linear, poles);
        const VectorXd back = gram.size.tail(poles);
        of_poles = back.asDiagonal() *
                   (gram.values.bottomRightCorner(poles, poles) - across.transpose() * explained.solve(across)) *
                   back.asDiagonal();
        of_shapes = explained.solve(MatrixXd::Identity(linear, linear)).diagonal().array() /
                    gram.size.head(linear).array().square();
    }
};

/// Covariance of the real and imaginary part of the pole of mode k. @param noise  variance of a sample of each output
Eigen::Matrix2d of_pole(const fit_sums& sums, const MatrixXd& of_poles, const VectorXd& noise, std::size_t k) {
    const Index n = of_poles.rows();
    MatrixXd known = MatrixXd::Zero(n, n), turn = MatrixXd::Zero(n, n);
    for (Index o = 0; o < noise.size(); ++o) {
        for (std::size_t i = 0; i < sums.modes.size(); ++i) {
            const complex c = sums.modes[i]->shape[static_cast<std::size_t>(o)];
            const auto at = static_cast<Index>(2 * i);
            turn.block<2, 2>(at, at) << c.real(), -c.imag(), -c.imag(), -c.real(); // Re(c d (a + ib))
        }
        known += turn.transpose() * of_poles * turn / noise[o];
    }
    const scaled_matrix scaled(known);
    const MatrixXd inverse = scaled.values.ldlt().solve(MatrixXd::Identity(n, n));
    const auto at = static_cast<Index>(2 * k);
    const Eigen::Vector2d unit = scaled.size.segment<2>(at).cwiseInverse();
    return unit.asDiagonal() * inverse.block<2, 2>(at, at) * unit.asDiagonal();
}

/// Deviations of f (Hz) and zeta; 0 or NaN: not known.
std::pair<double, double> of_values(const listed_mode& mode, const Eigen::Matrix2d& pole) {
    const double zeta = mode.damping_ratio, side = std::sqrt(1 - zeta * zeta), omega = 2 * M_PI * mode.frequency_hz;
    const Eigen::Vector2d by_f = Eigen::Vector2d(-zeta, side) / (2 * M_PI),
                          by_zeta = -side * Eigen::Vector2d(side, zeta) / omega;
    return {std::sqrt(by_f.dot(pole * by_f)), std::sqrt(by_zeta.dot(pole * by_zeta))};
}

/// Deviation of an entry of the shape, whose largest is 1, the poles held. @param of_entry  inverse of the Gram matrix of its factor
double of_shape(const listed_mode& mode, const VectorXd& noise, double of_entry, std::size_t o) {
    std::size_t top = 0;
    for (std::size_t i = 1; i < mode.shape.size(); ++i)
        if (std::abs(mode.shape[i]) > std::abs(mode.shape[top])) top = i;
    if (o == top) return 0;
    return std::sqrt(of_entry *
                     (noise[static_cast<Index>(o)] + std::norm(mode.shape[o]) * noise[static_cast<Index>(top)]));
}

} // namespace

void deviations_by_fit(const std::vector<listed_mode>& listed, record_work& work) {
    result_context& context = work.context;
    if (work.set.n_u == 0 || !context.sigma || !context.x0 || work.before) return;
    deviations& sigma = *context.sigma;
    fit_sums sums{work, {}, gram_sum(0), {}, {}, {}};
    std::vector<std::size_t> place; // in the list, of a mode of the model
    bool missing = false;
    for (std::size_t i = 0; i < listed.size(); ++i) {
        if (!listed[i].in_model) continue;
        sums.modes.push_back(&listed[i]);
        place.push_back(i);
        missing = missing || std::isnan(sigma.frequency_hz[i]);
    }
    const bool event = has_event(work.set);
    if (place.empty() || (!missing && !event)) return;
    const std::size_t n_y = work.set.n_y;
    const Index size = sums.linear() + static_cast<Index>(2 * place.size());
    sums.gram = gram_sum(size);
    sums.of_block.assign(place.size(), std::vector<double>(event_blocks));
    const VectorXd none = VectorXd::Zero(static_cast<Index>(n_y));
    sums.heard.assign(place.size(), none);
    sums.left.assign(place.size(), {none, none});
    for (std::size_t r = 0; r < work.set.records.size(); ++r) sums.add(r);
    const fit_information information(sums);
    for (std::size_t k = 0; k < place.size(); ++k) {
        const std::size_t i = place[k];
        const std::vector<double>& of_block = sums.of_block[k];
        const bool of_event = event && largest_share(of_block) >= most_of_one_block;
        if (!std::isnan(sigma.frequency_hz[i]) && !of_event) continue;
        const VectorXd left = sums.left[k].at_the_mode();
        if (!(sums.heard[k].minCoeff() > 0) || !(left.minCoeff() > 0)) continue;
        // as if all samples had been measured: fewer tell less
        const double energy = std::accumulate(of_block.begin(), of_block.end(), 0.0);
        const VectorXd noise = energy * left.array() / sums.heard[k].array().square();
        const auto [f, zeta] = of_values(listed[i], of_pole(sums, information.of_poles, noise, k));
        // a run through the model ends where a force is missing, which may be too early to tell anything
        if (!(f > 0) || !(zeta > 0) || !(f < 0.5 / work.model.dt) || !(zeta < 1)) continue;
        sigma.frequency_hz[i] = std::hypot(f, work.apart[i].first);
        sigma.damping_ratio[i] = std::hypot(zeta, work.apart[i].second);
        const double of_entry = information.of_shapes.segment<2>(static_cast<Index>(2 * k)).mean();
        for (std::size_t o = 0; o < n_y; ++o)
            sigma.shape_re[i * n_y + o] = sigma.shape_im[i * n_y + o] = of_shape(listed[i], noise, of_entry, o);
    }
}

bool doubt_wide(std::vector<listed_mode>& listed, record_work& work) {
    if (work.set.n_u == 0 || work.set.n_y > 1 || !work.context.sigma) return false;
    bool any = false;
    for (std::size_t k = 0; k < listed.size(); ++k) {
        listed_mode& mode = listed[k];
        if (!mode.in_model || !(work.context.sigma->damping_ratio[k] > judgement::wide_damping * mode.damping_ratio ||
                                work.context.sigma->frequency_hz[k] > judgement::widest_frequency * mode.frequency_hz))
            continue;
        doubt("wide_sigma", work.context.verdicts[k], mode);
        any = true;
    }
    return any;
}

} // namespace okid_host
