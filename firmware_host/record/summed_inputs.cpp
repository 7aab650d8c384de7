// SPDX-License-Identifier: MIT
// PURPOSE  B and D of modes whose force acts in samples that are no longer kept
// METHOD   the model that carries the modes has B and D from sums; the residue of a pole is C v w' B, v and w' its right and left
//          eigenvectors
#include "summed_inputs.hpp"

#include "carrier.hpp"

#include <cmath>
#include <memory>
#include <new>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

constexpr double quiet = 0.05; // of a force's energy

/// Mean square of each force over all samples; no numbers without sums.
Eigen::VectorXd force_power(const record_level& level, int n_u, int n_y, bool at_rest, double& rows) {
    const owned_sums sums = level_sums(level, n_u, n_y, 1, at_rest);
    const Index size = Index{n_u + n_y} * 2;
    MatrixXd gram(size, size);
    if (!sums.sums || okid_accumulator_gram(sums.sums, OKID_DETREND_NONE, gram.data(), nullptr) < 0) return {};
    rows = static_cast<double>(okid_accumulator_rows(sums.sums));
    return gram.diagonal().head(n_u) / rows;
}

} // namespace

bool force_is_older(const record_level& level, int n_u, int n_y, bool at_rest) {
    if (!level.older || n_u == 0) return false;
    double rows = 0;
    const Eigen::VectorXd power = force_power(level, n_u, n_y, at_rest, rows);
    double kept = 0;
    std::vector<double> square(static_cast<std::size_t>(n_u));
    for (const sample_rows& records : level.records)
        for (std::size_t i = 0; i < records.size(); i += static_cast<std::size_t>(n_u + n_y), ++kept)
            for (std::size_t k = 0; k < square.size(); ++k)
                if (!std::isnan(records[i + k])) square[k] += records[i + k] * records[i + k];
    for (Index k = 0; k < power.size(); ++k)
        if (square[static_cast<std::size_t>(k)] < quiet * power[k] * std::max(rows, kept)) return true;
    return false;
}

mode_inputs summed_inputs(const record_level& level, const std::vector<consensus_run>& runs,
                          const std::vector<mode_shift>& wanted, int n_u, int n_y, bool at_rest) {
    mode_inputs out;
    const consensus_run* const run = long_run(runs, 0);
    if (!run || wanted.empty()) return out;
    okid_identify_config_t config = run_config(*run, n_u, n_y);
    const auto sums = sums_of(*run, level, n_u, n_y, at_rest);
    const std::vector<int> orders = carrying_orders(*run, wanted);
    if (!sums->sums || orders.empty()) return out;
    config.order = config.max_order = orders.front();
    const std::size_t bytes = okid_identify_memsize(&config);
    const std::unique_ptr<std::byte[]> block(bytes ? new (std::nothrow) std::byte[bytes] : nullptr);
    okid_identify_t* identifier = nullptr;
    okid_identified_t model{};
    if (!block || okid_identify_create(&identifier, &config, block.get(), bytes) != OKID_OK ||
        okid_identify_run(identifier, sums->sums, &model) < 0)
        return out;
    const Eigen::Map<const MatrixXd> A(model.A, model.n_z, model.n_z), B(model.B, model.n_z, n_u),
        C(model.C, n_y, model.n_z), D(model.D, n_y, n_u);
    const Eigen::EigenSolver<MatrixXd> poles(A);
    const MatrixXcd V = poles.eigenvectors(), W = V.partialPivLu().inverse();
    const Eigen::Map<const Eigen::VectorXd> scale(level.scale.data(), n_u + n_y);
    const Eigen::VectorXd to = scale.tail(n_y), from = scale.head(n_u).cwiseInverse();
    const auto carried = carried_by(model, {}, wanted);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        if (!carried[i]) return {};
        const double w = 2 * M_PI * carried[i]->frequency_hz * model.dt, zeta = carried[i]->damping_ratio;
        const std::complex<double> mu = std::exp(w * std::complex<double>(-zeta, std::sqrt(1 - zeta * zeta)));
        Index at = 0;
        (poles.eigenvalues().array() - mu).abs().minCoeff(&at);
        const MatrixXcd residue = (C * V.col(at)) * (W.row(at) * B);
        if (!residue.allFinite()) return {};
        out.residues.emplace_back(to.asDiagonal() * residue * from.asDiagonal());
    }
    out.D = to.asDiagonal() * D * from.asDiagonal();
    return out;
}

} // namespace okid_host
