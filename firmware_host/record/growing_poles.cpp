// SPDX-License-Identifier: MIT
// PURPOSE  models that can be simulated where a subspace method put poles far outside the unit circle
// METHOD   an order above that of a structure under a band-limited force also models what its samples have of later forces
//          (the force between two samples is not held): poles of 2 to 25 times a sample. Over the record they grow beyond any
//          number, so that neither B and D nor a simulation exist. Each is reflected, as in vector fitting (Gustavsen & Semlyen
//          1999); A changes by what these poles and their vectors add to it
#include "growing_poles.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace okid_host {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;

int reflect_growing(std::size_t samples, int n_z, std::vector<double>& A) {
    Eigen::Map<MatrixXd> of(A.data(), n_z, n_z);
    const Eigen::EigenSolver<MatrixXd> found(of);
    if (found.info() != Eigen::Success) return 0;
    const double most = -std::log(std::numeric_limits<double>::epsilon()) / static_cast<double>(samples);
    const Eigen::VectorXcd& poles = found.eigenvalues();
    Eigen::VectorXcd step = Eigen::VectorXcd::Zero(n_z);
    int count = 0;
    for (int k = 0; k < n_z; ++k) {
        if (!(std::log(std::abs(poles[k])) > most)) continue;
        step[k] = 1.0 / std::conj(poles[k]) - poles[k];
        ++count;
    }
    if (count == 0) return 0;
    const MatrixXcd vectors = found.eigenvectors();
    const MatrixXd change = (vectors * step.asDiagonal() * vectors.inverse()).real();
    if (!change.allFinite()) return 0;
    of += change;
    return count;
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
        fmt::format("{} of {} poles grow by more than any number over the record (up to {:.3g} times a sample): they "
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
