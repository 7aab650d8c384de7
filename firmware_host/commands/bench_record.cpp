// SPDX-License-Identifier: MIT
#include "bench_record.hpp"

#include "rig/gaussian.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double end_damping = 0.01;
constexpr std::uint64_t seed = 1;

bench_structure proportional(const char* name, MatrixXd M, MatrixXd K, std::vector<int> forces) {
    const auto [alpha, beta] = rayleigh_coefficients(M, K, end_damping, end_damping);
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(K, M, Eigen::EigenvaluesOnly);
    rig_modes truth;
    for (const double square : solver.eigenvalues()) {
        const double omega = std::sqrt(square);
        truth.frequency_hz.push_back(omega / (2 * M_PI));
        truth.damping_ratio.push_back((alpha / omega + beta * omega) / 2);
    }
    return {name, {M, K, alpha * M + beta * K}, truth, std::move(forces)};
}

bench_structure chain(const char* name, const std::vector<double>& masses, const std::vector<double>& springs,
                      std::vector<int> forces) {
    const MatrixXd M = Eigen::Map<const VectorXd>(masses.data(), static_cast<Index>(masses.size())).asDiagonal();
    return proportional(name, M, chain_stiffness(springs), std::move(forces));
}

/// Ten masses that are coupled to their neighbours, and braces between every other one.
bench_structure braced_chain() {
    constexpr Index n = 10;
    std::vector<double> springs(n);
    MatrixXd M = MatrixXd::Zero(n, n);
    for (Index i = 0; i < n; ++i) {
        M(i, i) = 4.0 - 0.2 * static_cast<double>(i);
        springs[static_cast<std::size_t>(i)] = 4e5 - 2e5 * static_cast<double>(i) / (n - 1);
    }
    MatrixXd K = chain_stiffness(springs);
    for (Index i = 0; i + 1 < n; ++i) M(i, i + 1) = M(i + 1, i) = 0.05 * M(i, i);
    for (Index i = 0; i + 2 < n; ++i) {
        K(i, i) += 3e4;
        K(i + 2, i + 2) += 3e4;
        K(i, i + 2) -= 3e4;
        K(i + 2, i) -= 3e4;
    }
    return proportional("W3", M, K, {1, 5, 10});
}

/// Outputs of the held forces, column n of the result is sample n.
MatrixXd simulate(const discrete_model& model, const MatrixXd& u) {
    MatrixXd y(model.C.rows(), u.cols());
    VectorXd x = VectorXd::Zero(model.A.rows()), next = x;
    for (Index n = 0; n < u.cols(); ++n) {
        y.col(n).noalias() = model.C * x + model.D * u.col(n);
        next.noalias() = model.A * x + model.B0 * u.col(n);
        x = next;
    }
    return y;
}

void quantise(bench_record& record) {
    const int m = record.n_u + record.n_y;
    const Eigen::Map<const MatrixXd> v(record.v.data(), m, record.samples);
    record.codes.resize(record.v.size());
    for (int c = 0; c < m; ++c) {
        const double scale = v.row(c).cwiseAbs().maxCoeff() / 32000;
        record.scale.push_back(scale);
        for (int n = 0; n < record.samples; ++n)
            record.codes[static_cast<std::size_t>(n) * static_cast<std::size_t>(m) + static_cast<std::size_t>(c)] =
                static_cast<std::int16_t>(std::lround(v(c, n) / scale));
    }
}

} // namespace

const std::vector<bench_structure>& bench_structures() {
    static const std::vector<bench_structure> all{
        chain("W1", {1.0, 0.8, 1.2}, {3e4, 2e4, 2.5e4}, {1}),
        chain("W2", {2.0, 1.5, 1.8, 1.2, 1.6, 1.0}, {8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4}, {1, 4}), braced_chain()};
    return all;
}

bench_record make_record(const bench_structure& from, int samples, double noise_percent) {
    bench_record record{};
    record.n_u = static_cast<int>(from.force_dofs.size());
    record.n_y = static_cast<int>(from.body.M.rows());
    record.order = 2 * record.n_y;
    record.samples = samples;
    record.truth = from.truth;
    record.rate_hz = 2 * record.truth.frequency_hz.back() / 0.6;
    std::vector<int> sensors(static_cast<std::size_t>(record.n_y));
    for (std::size_t o = 0; o < sensors.size(); ++o) sensors[o] = static_cast<int>(o) + 1;
    const discrete_model model = discretise(from.body, from.force_dofs, sensors, "acceleration", "zoh", record.rate_hz);
    gaussian force(seed, 0), noise(seed, 1);
    MatrixXd u(record.n_u, samples);
    for (Index k = 0; k < u.size(); ++k) u.data()[k] = force.next();
    MatrixXd y = simulate(model, u);
    const VectorXd sigma = noise_percent / 100 * (y.rowwise().squaredNorm() / samples).cwiseSqrt();
    for (Index n = 0; n < y.cols(); ++n)
        for (Index o = 0; o < y.rows(); ++o) y(o, n) += sigma(o) * noise.next();
    record.v.resize(static_cast<std::size_t>(u.size() + y.size()));
    Eigen::Map<MatrixXd> v(record.v.data(), record.n_u + record.n_y, samples);
    v << u, y;
    quantise(record);
    return record;
}

mode_error compare_modes(const rig_modes& truth, const double* frequency_hz, const double* damping_ratio, int count) {
    mode_error worst{0, 0};
    for (std::size_t k = 0; k < truth.frequency_hz.size(); ++k) {
        const double f = truth.frequency_hz[k], zeta = truth.damping_ratio[k];
        int best = -1;
        for (int j = 0; j < count; ++j)
            if (best < 0 || std::abs(frequency_hz[j] - f) < std::abs(frequency_hz[best] - f)) best = j;
        const double error = best < 0 ? 1 : std::abs(frequency_hz[best] - f) / f;
        constexpr double missing = std::numeric_limits<double>::infinity();
        worst.frequency = std::max(worst.frequency, error < 0.05 ? error : missing);
        worst.damping = std::max(worst.damping, error < 0.05 ? std::abs(damping_ratio[best] - zeta) / zeta : missing);
    }
    return worst;
}

} // namespace okid_host
