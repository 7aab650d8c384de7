// SPDX-License-Identifier: MIT
// PURPOSE  the Kalman gain of a modal model
// METHOD   the covariances of what the simulation leaves give each mode the power of a white force of its own, the rest is noise of
//          the sensors; the Riccati equation of these (structured doubling, Chu, Fan & Lin 2005) gives a stable start. Where the
//          innovations are still correlated, C_k = C (A - K C)^(k-1) G tells the step K + G C_0^-1 that makes them white (Carew &
//          Belanger 1973); it is taken while the innovations become smaller and the predictor stays stable
#include "modal_gain.hpp"

#include "record_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int gain_lags = 40, most_steps = 3, doublings = 40;
constexpr double least_noise = 0.02; // of an output's variance
constexpr double least_force = 1e-4; // of the variance a mode would need to explain its share alone

/// Covariances at lags 0 .. `lags` of rows of numbers, pairs with a missing one left out.
std::vector<MatrixXd> covariances(const std::vector<double>& rows, Index n, int lags) {
    const Index count = static_cast<Index>(rows.size()) / n;
    const Eigen::Map<const MatrixXd> given(rows.data(), n, count);
    const auto there = (given.array() == given.array()).colwise().all().eval();
    MatrixXd x = given;
    for (Index t = 0; t < count; ++t)
        if (!there[t]) x.col(t).setZero();
    const double used = std::max<double>(1, static_cast<double>(there.count()));
    std::vector<MatrixXd> out;
    for (Index k = 0; k <= lags && k < count; ++k)
        out.emplace_back(x.rightCols(count - k) * x.leftCols(count - k).transpose() / used);
    return out;
}

/// P of P = A P A' - A P C' (C P C' + R)^-1 C P A' + Q.
MatrixXd riccati(const MatrixXd& A0, const MatrixXd& C, const MatrixXd& Q, const MatrixXd& R) {
    const Index n = A0.rows();
    MatrixXd A = A0.transpose(), G = C.transpose() * R.ldlt().solve(C), H = Q;
    for (int k = 0; k < doublings; ++k) {
        const auto W = (MatrixXd::Identity(n, n) + G * H).partialPivLu();
        const MatrixXd WA = W.solve(A), WG = W.solve(G), more = A.transpose() * H * WA;
        G += A * WG * A.transpose();
        A = A * WA;
        H += more;
        if (!(more.norm() > 1e-12 * H.norm())) break;
    }
    return (H + H.transpose()) / 2;
}

struct gain_search {
    record_work& work;
    okid_identified_t model;
    MatrixXd A, C; ///< of outputs in units of what the simulation leaves
    VectorXd unit;

    MatrixXd K, C0;             ///< the best so far, and its innovations
    std::vector<MatrixXd> C_of; ///< at all lags
    double cost = INFINITY;

    bool stable(const MatrixXd& gain) const {
        return gain.allFinite() && (A - gain * C).eigenvalues().cwiseAbs().maxCoeff() < 1;
    }

    /// Take this gain if it is stable and predicts better.
    bool take(const MatrixXd& gain) {
        if (!stable(gain)) return false;
        const MatrixXd real = gain * unit.cwiseInverse().asDiagonal();
        model.K = real.data();
        return better(gain, residuals(work.set, model, &work.states));
    }

    bool better(const MatrixXd& gain, std::vector<double> left) {
        const Index n_y = C.rows();
        for (std::size_t i = 0; i < left.size(); ++i) left[i] /= unit[static_cast<Index>(i) % n_y];
        const double now = covariances(left, n_y, 0)[0].diagonal().array().log().sum();
        if (!(now < cost)) return false;
        cost = now;
        K = gain;
        C_of = covariances(left, n_y, gain_lags);
        C0 = C_of[0];
        return true;
    }

    /// A start from the power of each mode and the noise of each output.
    MatrixXd start() const {
        const Index n = A.rows(), modes = n / 2, n_y = C.rows();
        MatrixXd normal = MatrixXd::Zero(modes, modes), power = MatrixXd::Identity(n, n);
        VectorXd right = VectorXd::Zero(modes);
        for (std::size_t k = 1; k < C_of.size(); ++k) {
            power = A * power;
            MatrixXd basis(n_y * n_y, modes);
            for (Index j = 0; j < modes; ++j) {
                const MatrixXd one =
                    C.middleCols(2 * j, 2) * power.block(2 * j, 2 * j, 2, 2) * C.middleCols(2 * j, 2).transpose();
                basis.col(j) = one.reshaped();
            }
            normal += basis.transpose() * basis;
            right += basis.transpose() * C_of[k].reshaped();
        }
        normal.diagonal() *= 1 + 1e-9;
        VectorXd variance = normal.ldlt().solve(right);
        VectorXd noise = C_of[0].diagonal();
        MatrixXd Q = MatrixXd::Zero(n, n);
        for (Index j = 0; j < modes; ++j) {
            const double whole = C.middleCols(2 * j, 2).squaredNorm(),
                         share = C_of[0].trace() / std::max(whole, 1e-300);
            variance[j] = std::isfinite(variance[j]) ? std::clamp(variance[j], least_force * share, share) : share;
            Q.block(2 * j, 2 * j, 2, 2)
                .diagonal()
                .setConstant(variance[j] * std::max(1e-12, 1 - std::pow(A.block(2 * j, 2 * j, 2, 1).norm(), 2)));
            noise -= variance[j] * C.middleCols(2 * j, 2).rowwise().squaredNorm();
        }
        noise = noise.cwiseMax(least_noise * C_of[0].diagonal());
        const MatrixXd R = noise.asDiagonal(), P = riccati(A, C, Q, R);
        return A * P * C.transpose() * (C * P * C.transpose() + R).inverse();
    }

    /// The step that would make the innovations white.
    MatrixXd whitening() const {
        const Index n = A.rows(), n_y = C.rows(), lags = static_cast<Index>(C_of.size()) - 1;
        MatrixXd seen(lags * n_y, n), right(lags * n_y, n_y), row = C;
        const MatrixXd closed = A - K * C;
        for (Index k = 0; k < lags; ++k, row = row * closed) {
            seen.middleRows(k * n_y, n_y) = row;
            right.middleRows(k * n_y, n_y) = C_of[static_cast<std::size_t>(k) + 1];
        }
        MatrixXd normal = seen.transpose() * seen;
        normal.diagonal().array() += 1e-6 * normal.diagonal().maxCoeff();
        return normal.ldlt().solve(seen.transpose() * right) * C0.inverse();
    }
};

} // namespace

void find_gain(record_work& work) {
    refined_arrays& arrays = *work.refined;
    okid_identified_t& model = work.model;
    const Index n = model.n_z, n_y = model.n_y;
    const MatrixXd none = MatrixXd::Zero(n, n_y);
    const std::vector<double> left =
        residuals(work.set, model, &work.states); // of the simulation: K of a modal model is 0 so far
    const std::vector<MatrixXd> first = covariances(left, n_y, 0);
    if (n == 0 || first.empty() || !(first[0].diagonal().minCoeff() > 0) || !first[0].allFinite()) return;
    const VectorXd unit = first[0].diagonal().cwiseSqrt();
    gain_search search{work,
                       model,
                       Eigen::Map<const MatrixXd>(model.A, n, n),
                       unit.cwiseInverse().asDiagonal() * Eigen::Map<const MatrixXd>(model.C, n_y, n),
                       unit,
                       {},
                       {},
                       {}};
    if (!search.stable(none) || !search.better(none, left)) return;
    if (search.take(search.start()))
        for (int k = 0; k < most_steps; ++k) {
            const MatrixXd step = search.whitening(), before = search.K;
            if (!search.take(before + step) && !search.take(before + step / 2)) break;
        }
    Eigen::Map<MatrixXd>(arrays.K.data(), n, n_y) = search.K * unit.cwiseInverse().asDiagonal();
    arrays.innovation.resize(static_cast<std::size_t>(n_y * n_y));
    Eigen::Map<MatrixXd>(arrays.innovation.data(), n_y, n_y) = unit.asDiagonal() * search.C0 * unit.asDiagonal();
    model.K = arrays.K.data();
    model.innovation = arrays.innovation.data();
}

} // namespace okid_host
