// SPDX-License-Identifier: MIT
// PURPOSE   virtual sensors: outputs that are not measured, gaps and forces, with standard deviations
// METHOD    Kalman filter of the innovation form: state noise K e, correlated with the noise e of the outputs. What is not
//           measured leaves the update; a measured input that is missing is white noise of its own strength. Forces without a
//           sensor are states (joint input-state estimation)
// REFERENCE Lourens et al. (2012), augmented Kalman filter; Anderson, Moore, Optimal Filtering, 5.5
// NUMERICS  gains of a pattern of sensors stay once the covariance moves by less than 1e-8 of its largest entry a sample
#include "virtual_filter.hpp"

#include "error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double settled_change = 1e-8;     // of the covariance, a sample
constexpr std::size_t tried_samples = 1500; // of a record, for the deviations
constexpr double gap_s = 60;                // followed; behind it an output is at the spread of its structure

} // namespace

virtual_filter::virtual_filter(virtual_model model) : model_(std::move(model)), n_(model_.A.rows()) {
    now_.y.setZero(model_.n_y());
    now_.y_std.setZero(model_.n_y());
    augment();
    reset();
}

void virtual_filter::augment() {
    const virtual_model& m = model_;
    forces_ = m.force_std.size();
    A_ = MatrixXd::Zero(n_ + forces_, n_ + forces_);
    Q_ = A_;
    S_ = MatrixXd::Zero(n_ + forces_, m.n_y());
    A_.topLeftCorner(n_, n_) = m.A;
    S_.topRows(n_) = m.K * m.noise;
    Q_.topLeftCorner(n_, n_) = S_.topRows(n_) * m.K.transpose();
    C_.resize(m.n_y(), n_ + forces_);
    C_.leftCols(n_) = m.C;
    B_ = m.B;
    D_ = m.D;
    if (forces_ == 0) return;
    const double keep = m.force_hz > 0 ? std::exp(-2 * M_PI * m.force_hz * m.dt) : 0.0;
    A_.topRightCorner(n_, forces_) = m.B;
    A_.bottomRightCorner(forces_, forces_).diagonal().setConstant(keep);
    Q_.bottomRightCorner(forces_, forces_).diagonal() = (1 - keep * keep) * m.force_std.cwiseAbs2();
    C_.rightCols(forces_) = m.D;
    B_.resize(n_ + forces_, 0);
    D_.resize(m.n_y(), 0);
}

void virtual_filter::reset() {
    x_ = VectorXd::Zero(n_ + forces_);
    P_ = MatrixXd::Zero(n_ + forces_, n_ + forces_);
    if (forces_ > 0) P_.bottomRightCorner(forces_, forces_).diagonal() = model_.force_std.cwiseAbs2();
    pattern_.clear();
    settled_ = false;
}

/// Gains for what is there, and the covariance of the next state.
void virtual_filter::find_gains() {
    const bool same = there_ == pattern_;
    if (same && settled_) return;
    const Index n_u = model_.n_u(), n_y = model_.n_y();
    MatrixXd R = model_.noise, S = S_, Q = Q_;
    for (Index i = 0; i < n_u; ++i) {
        if (there_[static_cast<std::size_t>(i)]) continue;
        if (model_.input_std.size() == 0)
            throw failure(exit_usage, fmt::format("input {} is missing, expected a number: how strong it is was not "
                                                  "learnt from a record",
                                                  model_.inputs[static_cast<std::size_t>(i)]));
        const double variance = model_.input_std[i] * model_.input_std[i];
        R += variance * D_.col(i) * D_.col(i).transpose();
        S += variance * B_.col(i) * D_.col(i).transpose();
        Q += variance * B_.col(i) * B_.col(i).transpose();
    }
    seen_.clear();
    for (Index i = 0; i < n_y; ++i)
        if (there_[static_cast<std::size_t>(n_u + i)]) seen_.push_back(i);
    const MatrixXd CP = C_ * P_, whole = CP * C_.transpose() + R;
    const MatrixXd from = A_ * CP.transpose() + S;
    const MatrixXd to_state = from(Eigen::all, seen_), to_y = whole(Eigen::all, seen_),
                   to_force = CP.transpose()(Eigen::seqN(n_, forces_), seen_);
    const Eigen::LDLT<MatrixXd> inverse(whole(seen_, seen_));
    const auto times_inverse = [&inverse](const MatrixXd& m) -> MatrixXd {
        if (m.size() == 0) return m; // no force is sought, or no sensor is there
        return inverse.solve(m.transpose()).transpose();
    };
    gain_ = times_inverse(to_state);
    to_y_ = times_inverse(to_y);
    to_force_ = times_inverse(to_force);
    now_.y_std = (whole.diagonal() - to_y_.cwiseProduct(to_y).rowwise().sum()).cwiseMax(0).cwiseSqrt();
    now_.y_std.array() *= model_.widen.array();
    for (const Index i : seen_) now_.y_std[i] = 0;
    now_.force_std =
        (P_.diagonal().tail(forces_) - to_force_.cwiseProduct(to_force).rowwise().sum()).cwiseMax(0).cwiseSqrt();
    MatrixXd next = A_ * P_ * A_.transpose() + Q - gain_ * to_state.transpose();
    next = 0.5 * (next + next.transpose()).eval();
    const double size = std::max(next.cwiseAbs().maxCoeff(), Q.cwiseAbs().maxCoeff()); // all measured: P dies out
    settled_ = same && (next - P_).cwiseAbs().maxCoeff() <= settled_change * size;
    P_ = std::move(next);
    pattern_ = there_;
}

const virtual_filter::estimate& virtual_filter::step(const double* row) {
    const Index n_u = model_.n_u(), n_y = model_.n_y(), known = model_.B.cols();
    there_.resize(static_cast<std::size_t>(n_u + n_y));
    for (std::size_t i = 0; i < there_.size(); ++i) there_[i] = std::isfinite(row[i]);
    find_gains();
    u_.resize(n_u);
    for (Index i = 0; i < n_u; ++i) u_[i] = std::isfinite(row[i]) ? row[i] - model_.mean[i] : 0.0;
    now_.y = C_ * x_ + D_ * u_;
    e_.resize(static_cast<Index>(seen_.size()));
    for (std::size_t k = 0; k < seen_.size(); ++k)
        e_[static_cast<Index>(k)] = row[n_u + seen_[k]] - model_.mean[known + seen_[k]] - now_.y[seen_[k]];
    now_.y += to_y_ * e_ + model_.mean.tail(n_y);
    for (const Index i : seen_) now_.y[i] = row[n_u + i];
    now_.force = x_.tail(forces_) + to_force_ * e_;
    if (forces_ > 0) now_.force += model_.mean.head(known);
    x_ = A_ * x_ + B_ * u_ + gain_ * e_;
    return now_;
}

void virtual_filter::pass(std::int64_t count) {
    const auto most = static_cast<std::int64_t>(gap_s / model_.dt);
    const std::vector<double> nothing(static_cast<std::size_t>(model_.n_u() + model_.n_y()), NAN);
    for (std::int64_t k = 0; k < std::min(count, most); ++k) (void)step(nothing.data());
    if (count > most) x_.setZero();
}

/// Means, strength of the inputs, and the covariance of what the predictor leaves where every channel is there.
void virtual_filter::learn_noise(std::size_t count, const double* rows) {
    const Index n_y = model_.n_y(), known = model_.B.cols(), m = known + n_y;
    using by_row = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Map<const by_row> all(rows, static_cast<Index>(count), m);
    const auto there = all.array().isFinite();
    const Eigen::ArrayXd have = there.cast<double>().colwise().sum().transpose().max(1.0);
    const MatrixXd zeroed = there.select(all, 0.0);
    model_.mean = zeroed.colwise().sum().transpose().array() / have;
    const MatrixXd centred = there.select(all.rowwise() - model_.mean.transpose(), 0.0);
    const VectorXd spread = (centred.colwise().squaredNorm().transpose().array() / have).sqrt();
    model_.input_std = spread.head(known);
    const auto lead = static_cast<Index>(std::min(static_cast<std::size_t>(5 * n_), count / 4));
    VectorXd x = VectorXd::Zero(n_);
    MatrixXd sum = MatrixXd::Zero(n_y, n_y);
    Index complete = 0;
    for (Index k = 0; k < all.rows(); ++k) {
        const VectorXd u = centred.row(k).head(known).transpose();
        VectorXd e = centred.row(k).tail(n_y).transpose() - model_.C * x - model_.D * u;
        for (Index i = 0; i < n_y; ++i)
            if (!std::isfinite(all(k, known + i))) e[i] = 0;
        if (k >= lead && all.row(k).array().isFinite().all()) {
            sum += e * e.transpose();
            ++complete;
        }
        x = model_.A * x + model_.B * u + model_.K * e;
    }
    if (complete < 10 * n_y)
        throw failure(exit_usage,
                      fmt::format("{} complete samples of y, expected {} to know the noise", complete, 10 * n_y));
    model_.noise = sum / static_cast<double>(complete);
}

/// A model is never exact: the deviations of each sensor grow by what leaving it out of the record shows.
void virtual_filter::try_deviations(std::size_t count, const double* rows) {
    const Index n_y = model_.n_y(), n_u = model_.n_u(), known = model_.B.cols();
    const std::size_t first = count > tried_samples ? (count - tried_samples) / 2 : 0,
                      used = std::min(count, tried_samples);
    VectorXd widen = VectorXd::Ones(n_y);
    std::vector<double> row(static_cast<std::size_t>(n_u + n_y));
    for (Index lost = 0; lost < n_y && n_y > 1; ++lost) {
        reset();
        double sum = 0;
        std::size_t compared = 0;
        for (std::size_t k = 0; k < used; ++k) {
            const double* from = rows + (first + k) * static_cast<std::size_t>(known + n_y) + known - n_u;
            std::copy_n(from, row.size(), row.begin());
            const double truth = std::exchange(row[static_cast<std::size_t>(n_u + lost)], NAN);
            const estimate& found = step(row.data());
            const double ratio = (found.y[lost] - truth) / std::max(found.y_std[lost], 1e-300);
            if (k < used / 5 || !std::isfinite(ratio)) continue;
            sum += ratio * ratio;
            ++compared;
        }
        if (compared > 0) widen[lost] = std::max(1.0, std::sqrt(sum / static_cast<double>(compared)));
    }
    model_.widen = widen;
}

void virtual_filter::learn(std::size_t count, const double* rows) {
    model_.widen.setOnes(model_.n_y());
    learn_noise(count, rows);
    augment();
    try_deviations(count, rows);
    reset();
}

} // namespace okid_host
