// SPDX-License-Identifier: MIT
// PURPOSE  modal mass, stiffness and damping with standard deviations, from the residues at drive points
// METHOD   the residue of a normal mode is phi_o phi_i / (2 j w_d m); least squares over the drive points; k = m w^2,
//          c = 2 zeta w m; the same of every replicate, whose poles are matched by distance and shape
// REFERENCE  Ewins, Modal Testing, 2.4 and 4.4; deviations: okid/uncertainty.h
#include "modal_masses.hpp"

#include "drive_mass.hpp"
#include "json_number.hpp"
#include "shape_mac.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

namespace okid_host {
namespace {

using complex = std::complex<double>;
constexpr double farthest = 0.1, least_mac = 0.5; // of a mode from the one it is taken for, as in okid/uncertainty.h
constexpr double least_share = 0.75;              // of the information in the replicates that had the mode
constexpr std::size_t fewest = 3;

} // namespace

std::size_t largest_entry(const std::vector<complex>& shape) {
    return static_cast<std::size_t>(
        std::max_element(shape.begin(), shape.end(), [](complex a, complex b) { return std::norm(a) < std::norm(b); }) -
        shape.begin());
}

std::vector<drive_pair> drive_pairs(const mass_plan& plan) {
    std::vector<drive_pair> out;
    for (std::size_t o = 0; o < plan.outputs.size(); ++o)
        for (std::size_t i = 0; i < plan.inputs.size(); ++i)
            if (plan.outputs[o].dof > 0 && plan.outputs[o].dof == plan.inputs[i].dof)
                out.push_back({o, i, plan.outputs[o].reversed == plan.inputs[i].reversed ? 1.0 : -1.0});
    return out;
}

modal_mass mass_of_pole(complex pole, complex complex_kg) {
    modal_mass out;
    if (!std::isfinite(complex_kg.real()) || !std::isfinite(complex_kg.imag())) return out;
    out.kg = complex_kg.real();
    out.stiffness = out.kg * std::norm(pole);
    out.damping = -2 * pole.real() * out.kg;
    out.phase_deg = std::arg(complex_kg) * 180 / M_PI;
    return out;
}

modal_mass_statistics::modal_mass_statistics(const mass_plan& plan, double dt)
    : plan_(plan), dt_(dt), points_(drive_pairs(plan)) {}

std::vector<modal_mass_statistics::driven_mode> modal_mass_statistics::modes_in(const okid_model_t& model) const {
    using Eigen::MatrixXd;
    std::vector<driven_mode> out;
    if (model.B == nullptr || model.n_z < 1) return out;
    const Eigen::EigenSolver<MatrixXd> solved(Eigen::Map<const MatrixXd>(model.A, model.n_z, model.n_z));
    if (solved.info() != Eigen::Success) return out;
    const Eigen::MatrixXcd vectors = solved.eigenvectors();
    const Eigen::MatrixXcd seen = Eigen::Map<const MatrixXd>(model.C, model.n_y, model.n_z) * vectors;
    const Eigen::MatrixXcd driven =
        vectors.partialPivLu().solve(Eigen::Map<const MatrixXd>(model.B, model.n_z, model.n_u).cast<complex>());
    for (Eigen::Index k = 0; k < solved.eigenvalues().size(); ++k) {
        const complex mu = solved.eigenvalues()[k];
        if (!(mu.imag() > 0)) continue;
        driven_mode& mode = out.emplace_back();
        mode.pole = std::log(mu) / dt_;
        const complex turn = drive_factor(mode.pole, dt_, plan_.hold);
        for (Eigen::Index o = 0; o < seen.rows(); ++o) {
            const mass_channel& one = plan_.outputs[static_cast<std::size_t>(o)];
            mode.shape.push_back(one.si * seen(o, k) * to_displacement(mode.pole, one.sensing));
        }
        for (Eigen::Index i = 0; i < driven.cols(); ++i)
            mode.force.push_back(turn * driven(k, i) / plan_.inputs[static_cast<std::size_t>(i)].si);
    }
    return out;
}

modal_mass modal_mass_statistics::mass_of(const driven_mode& mode, std::size_t top) const {
    drive_mass found;
    for (const drive_pair& point : points_)
        found.add(mode.shape[point.output] / mode.shape[top],
                  point.sign * mode.shape[point.output] * mode.force[point.input]);
    return found.power > 0 ? mass_of_pole(mode.pole, found.complex_kg()) : modal_mass();
}

void modal_mass_statistics::begin(const okid_identified_t& full) {
    full_.assign(static_cast<std::size_t>(full.mode_count), {});
    replicates_.assign(full_.size(), {});
    if (!wanted()) return;
    const auto found = modes_in({full.n_u, full.n_y, full.n_z, full.A, full.B, full.C, full.D, nullptr});
    for (std::size_t k = 0; k < full_.size(); ++k) {
        const complex pole = continuous_pole(full.frequency_hz[k], full.damping_ratio[k]);
        const auto nearest = std::min_element(found.begin(), found.end(), [&](const auto& a, const auto& b) {
            return std::abs(a.pole - pole) < std::abs(b.pole - pole);
        });
        if (nearest != found.end() && std::abs(nearest->pole - pole) < 1e-3 * std::abs(pole)) full_[k] = *nearest;
    }
}

void modal_mass_statistics::add(const okid_model_t& replicate, double share) {
    if (!wanted()) return;
    const auto found = modes_in(replicate);
    for (std::size_t k = 0; k < full_.size(); ++k) {
        const driven_mode& own = full_[k];
        const driven_mode* best = nullptr;
        double least = HUGE_VAL;
        for (const driven_mode& other : found) {
            if (own.shape.empty() || !(std::abs(other.pole - own.pole) < farthest * std::abs(own.pole))) continue;
            const double alike = shape_mac(own.shape, other.shape);
            const double apart = std::abs(other.pole - own.pole) / std::abs(own.pole) + 1 - alike;
            if (alike >= least_mac && apart < least) least = apart, best = &other;
        }
        if (!best) continue;
        const modal_mass mass = mass_of(*best, largest_entry(own.shape));
        if (std::isfinite(mass.kg)) replicates_[k].push_back({share, mass});
    }
}

std::vector<modal_mass> modal_mass_statistics::finish() const {
    std::vector<modal_mass> out;
    if (!wanted()) return out;
    for (std::size_t k = 0; k < full_.size(); ++k) {
        modal_mass& one = out.emplace_back();
        if (full_[k].shape.empty()) continue;
        one = mass_of(full_[k], largest_entry(full_[k].shape));
        double share = 0, weight = 0, left = 0;
        for (const estimate& other : replicates_[k]) {
            share += other.share;
            weight += other.share * (1 - other.share);
            left += 1 - other.share;
        }
        if (replicates_[k].size() < fewest || share < least_share) continue;
        for (const auto& [value, deviation] : {std::pair{&modal_mass::kg, &modal_mass::kg_std},
                                               std::pair{&modal_mass::stiffness, &modal_mass::stiffness_std},
                                               std::pair{&modal_mass::damping, &modal_mass::damping_std}}) {
            double centre = 0, square = 0;
            for (const estimate& other : replicates_[k]) centre += (1 - other.share) * other.mass.*value / left;
            for (const estimate& other : replicates_[k])
                square += std::pow((1 - other.share) * (other.mass.*value - centre), 2);
            one.*deviation = std::sqrt(square / weight);
        }
    }
    return out;
}

std::vector<modal_mass> modal_masses_of(const okid_identified_t& model, const mass_plan& plan) {
    modal_mass_statistics masses(plan, model.dt);
    masses.begin(model);
    return masses.finish();
}

void put_modal_mass_json(const modal_mass& found, nlohmann::ordered_json& to) {
    to["modal_mass"] = number_json(found.kg);
    to["modal_mass_std"] = number_json(found.kg_std);
    to["modal_stiffness"] = number_json(found.stiffness);
    to["modal_stiffness_std"] = number_json(found.stiffness_std);
    to["modal_damping"] = number_json(found.damping);
    to["modal_damping_std"] = number_json(found.damping_std);
    to["modal_mass_phase_deg"] = number_json(found.phase_deg);
}

} // namespace okid_host
