// SPDX-License-Identifier: MIT
// Modal mass, stiffness and damping of a model with a drive point: a sensor at a degree of freedom where a force acts.
#pragma once
#include "mass_matrices.hpp"

#include <okid/model.h>

#include <complex>
#include <nlohmann/json.hpp>
#include <vector>

namespace okid_host {

/// Of a mode whose largest displacement is 1, in kg, N/m and N s/m; NaN: not known. `phase_deg`: how far the residue at the
/// drive points is from that of a normal mode (0).
struct modal_mass {
    double kg = NAN, stiffness = NAN, damping = NAN, phase_deg = NAN;
    double kg_std = NAN, stiffness_std = NAN, damping_std = NAN;
};

/// Of a plan, an output and an input at one degree of freedom; sign: -1 where one of them is reversed.
struct drive_pair {
    std::size_t output, input;
    double sign;
};
std::vector<drive_pair> drive_pairs(const mass_plan& plan);

/// Of a pole, from what its drive points say (drive_mass.hpp); all NaN where that is no number.
modal_mass mass_of_pole(std::complex<double> pole, std::complex<double> complex_kg);

/// The entry that a shape is divided by.
std::size_t largest_entry(const std::vector<std::complex<double>>& shape);

/// Collects the masses of one model and of the same without one block each (the jackknife of okid/uncertainty.h).
class modal_mass_statistics {
  public:
    modal_mass_statistics(const mass_plan& plan, double dt);

    /// Is there a drive point?
    bool wanted() const { return !points_.empty(); }
    /// The model that counts, with B.
    void begin(const okid_identified_t& full);
    /// A model of any realization, made without a block that held so much of the information (0 < share < 1).
    void add(const okid_model_t& replicate, double share);
    /// One for each mode of the full model; empty without a drive point.
    std::vector<modal_mass> finish() const;

  private:
    /// A pole of a model: its displacements at the sensors and what each force does to it.
    struct driven_mode {
        std::complex<double> pole;
        std::vector<std::complex<double>> shape, force;
    };
    struct estimate { ///< without one block
        double share;
        modal_mass mass;
    };
    std::vector<driven_mode> modes_in(const okid_model_t& model) const;
    modal_mass mass_of(const driven_mode& mode, std::size_t top) const;

    mass_plan plan_;
    double dt_;
    std::vector<drive_pair> points_;
    std::vector<driven_mode> full_;                 ///< of each mode of the full model; no shape: not found
    std::vector<std::vector<estimate>> replicates_; ///< of each of them
};

/// Those of one model, without deviations.
std::vector<modal_mass> modal_masses_of(const okid_identified_t& model, const mass_plan& plan);

/// What an entry of "modes" has of it.
void put_modal_mass_json(const modal_mass& found, nlohmann::ordered_json& to);

} // namespace okid_host
