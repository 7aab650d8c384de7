// SPDX-License-Identifier: MIT
// Modes of the structure and its exact discrete-time model.
#include "rig.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// First-order form of the structure (paper eq. 5, 6).
MatrixXd state_matrix(const structure& body) {
    const Index n = body.M.rows();
    const Eigen::LLT<MatrixXd> mass(body.M);
    MatrixXd A = MatrixXd::Zero(2 * n, 2 * n);
    A.topRightCorner(n, n).setIdentity();
    A.bottomLeftCorner(n, n) = -mass.solve(body.K);
    A.bottomRightCorner(n, n) = -mass.solve(body.R);
    return A;
}

/// Columns of the identity: where forces act or sensors sit.
MatrixXd selection(Index n, const std::vector<int>& dofs) {
    MatrixXd out = MatrixXd::Zero(n, static_cast<Index>(dofs.size()));
    for (std::size_t j = 0; j < dofs.size(); ++j) out(dofs[j] - 1, static_cast<Index>(j)) = 1;
    return out;
}

} // namespace

std::size_t rig::samples() const { return static_cast<std::size_t>(std::llround(rate_hz * duration_s)); }

MatrixXd chain_stiffness(const std::vector<double>& springs) {
    const auto n = static_cast<Index>(springs.size());
    MatrixXd K = MatrixXd::Zero(n, n);
    for (Index i = 0; i < n; ++i) {
        const double k = springs[static_cast<std::size_t>(i)];
        K(i, i) += k;
        if (i == 0) continue;
        K(i - 1, i - 1) += k;
        K(i - 1, i) -= k;
        K(i, i - 1) -= k;
    }
    return K;
}

std::pair<double, double> rayleigh_coefficients(const MatrixXd& M, const MatrixXd& K, double first, double last) {
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(K, M, Eigen::EigenvaluesOnly);
    const double low = std::sqrt(solver.eigenvalues()(0)), high = std::sqrt(solver.eigenvalues()(M.rows() - 1));
    if (M.rows() == 1 || high - low < 1e-9 * high) return {0.0, 2 * first / low};
    // zeta = alpha/(2 w) + beta w/2 at both ends
    const double beta = 2 * (last * high - first * low) / (high * high - low * low);
    return {2 * first * low - beta * low * low, beta};
}

rig_modes structure_modes(const structure& body) {
    // in mass-normalised coordinates and with the highest frequency as unit of time all entries are of one size
    const Index n = body.M.rows();
    const MatrixXd root = Eigen::LLT<MatrixXd>(body.M).matrixL();
    const auto normalised = [&](const MatrixXd& X) {
        const MatrixXd half = root.triangularView<Eigen::Lower>().solve(X);
        return MatrixXd(root.triangularView<Eigen::Lower>().solve(half.transpose()));
    };
    const MatrixXd stiffness = normalised(body.K);
    const double unit = std::sqrt(stiffness.norm());
    MatrixXd A = MatrixXd::Zero(2 * n, 2 * n);
    A.topRightCorner(n, n).setIdentity();
    A.bottomLeftCorner(n, n) = -stiffness / (unit * unit);
    A.bottomRightCorner(n, n) = -normalised(body.R) / unit;
    const Eigen::VectorXcd poles = A.eigenvalues() * unit;
    std::vector<std::pair<double, double>> pairs;
    for (Index i = 0; i < poles.size(); ++i) {
        const double size = std::abs(poles(i));
        if (!(poles(i).real() < 0)) return {};
        if (poles(i).imag() > 1e-12 * size) pairs.emplace_back(size / (2 * M_PI), -poles(i).real() / size);
    }
    if (static_cast<Index>(pairs.size()) != body.M.rows()) return {};
    std::sort(pairs.begin(), pairs.end());
    rig_modes out;
    for (const auto& [frequency, damping] : pairs) {
        out.frequency_hz.push_back(frequency);
        out.damping_ratio.push_back(damping);
    }
    return out;
}

discrete_model discretise(const structure& body, const std::vector<int>& force_dofs, const std::vector<int>& sense_dofs,
                          const std::string& sensing, const std::string& hold, double rate_hz) {
    const Index n = body.M.rows(), n_z = 2 * n, n_u = static_cast<Index>(force_dofs.size());
    const MatrixXd A = state_matrix(body);
    MatrixXd B = MatrixXd::Zero(n_z, n_u);
    B.bottomRows(n) = Eigen::LLT<MatrixXd>(body.M).solve(selection(n, force_dofs));

    // exp of [A B 0; 0 0 I/dt; 0 0 0] dt = [Ad G1 G2; 0 I I; 0 0 I]: G1 for a constant force, G2 for its slope
    const double dt = 1 / rate_hz;
    MatrixXd block = MatrixXd::Zero(n_z + 2 * n_u, n_z + 2 * n_u);
    block.topLeftCorner(n_z, n_z) = A * dt;
    block.block(0, n_z, n_z, n_u) = B * dt;
    block.block(n_z, n_z + n_u, n_u, n_u).setIdentity();
    const MatrixXd power = block.exp();
    const MatrixXd G1 = power.block(0, n_z, n_z, n_u), G2 = power.block(0, n_z + n_u, n_z, n_u);

    discrete_model out;
    out.A = power.topLeftCorner(n_z, n_z);
    const bool linear = hold == "foh";
    out.B0 = linear ? MatrixXd(G1 - G2) : G1;
    out.B1 = linear ? G2 : MatrixXd::Zero(n_z, n_u);
    const MatrixXd sensors = selection(n, sense_dofs).transpose();
    out.C = MatrixXd::Zero(sensors.rows(), n_z);
    out.D = MatrixXd::Zero(sensors.rows(), n_u);
    if (sensing == "acceleration") { // the last rows of x' = A x + B u
        out.C = sensors * A.bottomRows(n);
        out.D = sensors * B.bottomRows(n);
    } else if (sensing == "velocity") {
        out.C.rightCols(n) = sensors;
    } else {
        out.C.leftCols(n) = sensors;
    }
    return out;
}

} // namespace okid_host
