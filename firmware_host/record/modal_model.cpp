// SPDX-License-Identifier: MIT
// PURPOSE  the model of a set of modes
// METHOD   x = modal coordinates: [Re mu, -Im mu; Im mu, Re mu], mu = exp(lambda dt); y = Re of shape times coordinate; B and D
//          by output error over the records (okid_subspace_output_error)
#include "modal_model.hpp"

#include "consensus/consensus.hpp"
#include "record_fit.hpp"
#include "record_refine.hpp"
#include "result/deviations.hpp"
#include "result/hold.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace okid_host {
namespace {

void put_modes(const std::vector<listed_mode>& modes, refined_arrays& to, okid_identified_t& model) {
    for (const listed_mode& mode : modes) {
        to.frequency.push_back(mode.frequency_hz);
        to.damping.push_back(mode.damping_ratio);
        to.mpc.push_back(mode.mpc);
        to.emac.push_back(mode.emac);
        to.cmi.push_back(mode.emac * mode.mpc);
        for (const auto& entry : mode.shape) {
            to.shape_re.push_back(entry.real());
            to.shape_im.push_back(entry.imag());
        }
    }
    model.mode_count = static_cast<std::int32_t>(modes.size());
    to.show_modes(model);
}

void put_states(const std::vector<listed_mode>& modes, refined_arrays& to, okid_identified_t& model) {
    const auto n_y = static_cast<std::size_t>(model.n_y);
    std::vector<const listed_mode*> in;
    for (const listed_mode& mode : modes)
        if (mode.in_model) in.push_back(&mode);
    const std::size_t n = 2 * in.size();
    to.A.assign(n * n, 0.0);
    to.C.assign(n_y * n, 0.0);
    to.K.assign(n * n_y, 0.0);
    model.model_radius = 0;
    for (std::size_t k = 0; k < in.size(); ++k) {
        const std::complex<double> mu = discrete_pole(*in[k], model.dt);
        const std::size_t a = 2 * k, b = a + 1;
        to.A[a * n + a] = to.A[b * n + b] = mu.real();
        to.A[b * n + a] = -mu.imag();
        to.A[a * n + b] = mu.imag();
        for (std::size_t i = 0; i < n_y; ++i) {
            const std::complex<double> entry = in[k]->shape[i];
            if (std::isnan(entry.real())) continue; // not measured: 0
            to.C[a * n_y + i] = entry.real();
            to.C[b * n_y + i] = -entry.imag();
        }
        model.model_radius = std::max(model.model_radius, std::abs(mu));
    }
    model.n_z = static_cast<std::int32_t>(n);
    model.A = to.A.data();
    model.C = to.C.data();
    model.K = to.K.data();
}

/// B and D from residues: y = Re(shape x) of a state x that a unit force moves by b has 2 residue = shape b.
bool put_inputs(const std::vector<listed_mode>& modes, const mode_inputs& inputs, refined_arrays& to,
                const okid_identified_t& model) {
    if (inputs.residues.size() != modes.size() || inputs.residues.empty()) return false;
    const Eigen::Index n_u = model.n_u, n_y = model.n_y;
    to.B.assign(static_cast<std::size_t>(model.n_z * model.n_u), 0.0);
    Eigen::Map<Eigen::MatrixXd> B(to.B.data(), model.n_z, n_u);
    Eigen::Index row = 0;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        if (!modes[k].in_model) continue;
        const Eigen::Map<const Eigen::VectorXcd> shape(modes[k].shape.data(), n_y);
        if (inputs.residues[k].size() > 0) {
            const Eigen::RowVectorXcd b = 2 * shape.adjoint() * inputs.residues[k] / shape.squaredNorm();
            B.row(row) = b.real();
            B.row(row + 1) = b.imag();
        }
        row += 2;
    }
    to.D.assign(inputs.D.data(), inputs.D.data() + inputs.D.size());
    return true;
}

} // namespace

mode_verdict verdict_of(const consensus_mode& mode) { return {mode.confident(), mode.found_in, mode.why, mode.picked}; }

void doubt(const char* code, mode_verdict& verdict, listed_mode& mode) {
    verdict.why.emplace_back(code);
    verdict.confident = mode.in_model = false;
}

std::complex<double> discrete_pole(const listed_mode& mode, double dt) {
    return std::exp(continuous_pole(mode.frequency_hz, mode.damping_ratio) * dt);
}

void make_modal_model(const std::vector<listed_mode>& modes, double fs_hz, record_work& work) {
    work.refined = std::make_unique<refined_arrays>();
    refined_arrays& arrays = *work.refined;
    okid_identified_t& model = work.model = {};
    model.n_u = static_cast<std::int32_t>(work.set.n_u);
    model.n_y = static_cast<std::int32_t>(work.set.n_y);
    model.dt = 1 / fs_hz;
    model.noise_level = NAN;
    put_modes(modes, arrays, model);
    put_states(modes, arrays, model);
    work.states.clear();
    if (model.n_u == 0) return;
    const bool known = put_inputs(modes, work.inputs, arrays, model);
    const okid_status_t status =
        known ? OKID_OK : fit_outputs(work.set, model.n_z, model.A, model.C, arrays.B, arrays.D, &work.states);
    if (status < 0) {
        work.states.clear();
        std::fill(arrays.B.begin(), arrays.B.end(), 0.0);
        std::fill(arrays.D.begin(), arrays.D.end(), 0.0);
        work.context.warnings.emplace_back(
            "no_inputs_fitted",
            fmt::format("B and D could not be fitted to the record ({}): they are zero", okid_status_text(status)));
    }
    model.B = arrays.B.data();
    model.D = arrays.D.data();
    model.markov_count = markov_blocks;
    find_markov(model_view(model), markov_blocks, arrays.markov);
    model.markov = arrays.markov.data();
}

record_work modal_trial(const std::vector<listed_mode>& modes, record_set set, const record_options& options) {
    record_work out;
    out.set = std::move(set);
    if (options.detrend != "none") remove_means(out.set);
    make_modal_model(modes, options.fs_hz, out);
    return out;
}

void put_back_outputs(const std::vector<bool>& kept, record_work& work) {
    refined_arrays& arrays = *work.refined;
    okid_identified_t& model = work.model;
    const std::size_t n_y = kept.size(), n_z = static_cast<std::size_t>(model.n_z);
    const auto spread = [&](std::vector<double>& values, double missing) { // columns of outputs
        std::vector<double> out;
        for (auto from = values.begin(); from != values.end();)
            for (std::size_t i = 0; i < n_y; ++i) out.push_back(kept[i] ? *from++ : missing);
        values = std::move(out);
    };
    for (auto* values : {&arrays.shape_re, &arrays.shape_im, &arrays.C, &arrays.D, &arrays.markov})
        spread(*values, NAN);
    std::vector<double> gain; // n_z numbers of each output: one that is missing corrects nothing
    auto column = arrays.K.begin();
    for (std::size_t i = 0; i < n_y; ++i) {
        const auto from = kept[i] ? std::exchange(column, column + static_cast<std::ptrdiff_t>(n_z)) : column;
        gain.insert(gain.end(), n_z, 0.0);
        if (kept[i]) std::copy(from, column, gain.end() - static_cast<std::ptrdiff_t>(n_z));
    }
    arrays.K = std::move(gain);
    model.innovation = model.mean = nullptr;
    for (auto* percent : {&work.context.simulation_percent, &work.context.prediction_percent})
        if (*percent) spread(**percent, NAN);
    if (work.context.sigma)
        for (auto* values : {&work.context.sigma->shape_re, &work.context.sigma->shape_im}) spread(*values, NAN);
    if (work.context.refined) spread(work.context.refined->noise_std, NAN);
    model.n_y = static_cast<std::int32_t>(n_y);
    model.shape_re = arrays.shape_re.data();
    model.shape_im = arrays.shape_im.data();
    model.C = arrays.C.data();
    model.K = arrays.K.data();
    if (model.n_u == 0) return;
    model.D = arrays.D.data();
    model.markov = arrays.markov.data();
}

} // namespace okid_host
