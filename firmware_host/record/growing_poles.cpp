// SPDX-License-Identifier: MIT
// PURPOSE  models that can be simulated where a subspace method put poles far outside the unit circle
// METHOD   an order above that of a structure under a band-limited force also models what its samples have of later forces
//          (the force between two samples is not held): poles of 2 to 25 times a sample. Over the record they grow beyond any
//          number, so that neither B and D nor a simulation exist. Each is reflected, as in vector fitting (Gustavsen & Semlyen
//          1999): a Schur form with the growing poles last, A = U [T S; 0 G] U^H, its two blocks made independent,
//          T X - X G = -S, and G^-1 instead of G, whose poles are the reflected ones. No other pole or vector moves
// NUMERICS unitary rotations and triangular solutions; the eigenvectors of the stable poles, which may be close to each other,
//          are not asked for. B and D come from normal equations, where a signal's part of growth is squared: more than eps^-1/4
//          (8,000) over the record would leave less than half of the digits to everything else
#include "growing_poles.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/format.h>
#include <limits>

namespace okid_host {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;

namespace {

/// Exchange the poles k and k + 1 of a Schur form.
void exchange(MatrixXcd& T, MatrixXcd& U, Eigen::Index k) {
    const std::complex<double> before = T(k, k), after = T(k + 1, k + 1);
    Eigen::JacobiRotation<std::complex<double>> turn;
    turn.makeGivens(T(k, k + 1), after - before);
    T.rightCols(T.cols() - k).applyOnTheLeft(k, k + 1, turn.adjoint());
    T.topRows(k + 2).applyOnTheRight(k, k + 1, turn);
    U.applyOnTheRight(k, k + 1, turn);
    T(k, k) = after;
    T(k + 1, k + 1) = before;
    T(k + 1, k) = 0;
}

/// The poles beyond `radius` last, the others in their order. @return how many of them there are
Eigen::Index move_growing(MatrixXcd& T, MatrixXcd& U, double radius) {
    Eigen::Index count = 0;
    for (Eigen::Index k = T.rows() - 1; k >= 0; --k) {
        if (!(std::abs(T(k, k)) > radius)) continue;
        for (Eigen::Index at = k; at < T.rows() - 1 - count; ++at) exchange(T, U, at);
        ++count;
    }
    return count;
}

/// T X - X G = -S of upper triangular T and G.
MatrixXcd decouple(const MatrixXcd& T, const MatrixXcd& G, const MatrixXcd& S) {
    MatrixXcd X(S.rows(), S.cols());
    for (Eigen::Index j = 0; j < S.cols(); ++j) {
        MatrixXcd shifted = T;
        shifted.diagonal().array() -= G(j, j);
        X.col(j) = shifted.triangularView<Eigen::Upper>().solve(X.leftCols(j) * G.col(j).head(j) - S.col(j));
    }
    return X;
}

} // namespace

int reflect_growing(std::size_t samples, int n_z, std::vector<double>& A) {
    Eigen::Map<MatrixXd> of(A.data(), n_z, n_z);
    const Eigen::ComplexSchur<MatrixXd> found(of);
    if (found.info() != Eigen::Success) return 0;
    MatrixXcd T = found.matrixT(), U = found.matrixU();
    const double most = -std::log(std::numeric_limits<double>::epsilon()) / 4;
    const Eigen::Index growing = move_growing(T, U, std::exp(most / static_cast<double>(samples))),
                       rest = n_z - growing;
    if (growing == 0) return 0;
    const MatrixXcd G = T.bottomRightCorner(growing, growing).triangularView<Eigen::Upper>();
    const MatrixXcd X = decouple(T.topLeftCorner(rest, rest), G, T.topRightCorner(rest, growing));
    const MatrixXcd reflected =
        G.triangularView<Eigen::Upper>().solve(MatrixXcd::Identity(growing, growing)) - G; // the change of the block
    const MatrixXcd vectors = U.rightCols(growing) + U.leftCols(rest) * X;
    const MatrixXd change = (vectors * reflected * U.rightCols(growing).adjoint()).real();
    if (!change.allFinite()) return 0;
    of += change;
    return static_cast<int>(growing);
}

void reflect_growing(record_work& work, std::vector<replicate_model>& replicates) {
    okid_identified_t& model = work.model;
    const auto n = static_cast<std::size_t>(model.n_z);
    std::size_t samples = 0;
    for (const record_data& record : work.set.records) samples = std::max(samples, record.count);
    std::vector<double> A(model.A, model.A + n * n);
    const int count = reflect_growing(samples, model.n_z, A);
    if (count == 0) return;
    work.context.warnings.emplace_back(
        "poles_reflected",
        fmt::format("{} of {} poles grow by more than 8,000 times over the record (up to {:.3g} times a sample): they "
                    "are reflected into the unit circle. The order is above that of the structure, or the force is "
                    "not held between samples (an anti-alias filter): try a lower one",
                    count, n, model.model_radius));
    work.refined = std::make_unique<refined_arrays>();
    work.refined->A = std::move(A);
    model.A = work.refined->A.data();
    const auto radius_of = [&](const MatrixXd& X) { return X.eigenvalues().cwiseAbs().maxCoeff(); };
    const Eigen::Map<const MatrixXd> of(model.A, model.n_z, model.n_z), C(model.C, model.n_y, model.n_z);
    model.model_radius = radius_of(of);
    if (model.model_radius < 1) model.warnings &= ~static_cast<std::uint32_t>(OKID_NOTE_MODEL_UNSTABLE);
    std::vector<double>& K = work.refined->K;
    K.assign(n * static_cast<std::size_t>(model.n_y), 0.0);
    if (model.K && radius_of(of - Eigen::Map<const MatrixXd>(model.K, model.n_z, model.n_y) * C) < 1)
        std::copy_n(model.K, K.size(), K.begin());
    model.K = K.data();
    model.warnings &= ~static_cast<std::uint32_t>(OKID_NOTE_PREDICTOR_UNSTABLE);
    for (replicate_model& replicate : replicates)
        if (replicate.found()) reflect_growing(samples, replicate.n_z, replicate.A);
}

} // namespace okid_host
