// SPDX-License-Identifier: MIT
// From an identified model to mass, stiffness and damping: which channel stands at which degree of freedom, the matrices
// of okid/mkr.h and okid/mkr.h in SI units, their checks in words.
#pragma once
#include <okid/identify.h>
#include <okid/mkr.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// One force or sensor as the mechanics see it.
struct mass_channel {
    std::string name;
    int dof = 0;                           ///< from 1; 0 = at none of the degrees of freedom
    bool reversed = false;                 ///< the record has the other sign
    int sensing = OKID_SENSE_ACCELERATION; ///< okid_sensing_t, of a sensor
    double si = 1;                         ///< N, m/s^2, m/s or m for one unit of the record
};

struct mass_plan {
    std::vector<mass_channel> inputs, outputs; ///< both empty: M, K and R are not wanted
    std::string hold = "zoh";
    bool wanted() const { return !inputs.empty(); }
    int size() const; ///< degrees of freedom: the largest number
};

using remarks = std::vector<std::pair<std::string, std::string>>; ///< (code, text)
bool has_remark(const remarks& said, const char* code);

/// A mode that went into the matrices.
struct mass_mode {
    int number = 0; ///< in `modes` of the result, from 1
    double frequency_hz = 0, damping_ratio = 0, strength = 0, mpc = 0, phase = 0, pair_spread = 0;
    double at_force = 1;    ///< largest motion where a force and a sensor stand together, over that of the whole shape
    std::string force_name; ///< of the force there
};

/// Column-major n_x x n_x matrices and the numbers of okid_mkr_t; rows and columns are the degrees of freedom 1 … n_x.
struct mass_matrices {
    int n_x = 0;
    std::uint32_t notes = 0;
    std::vector<double> M, K, R, R_normal, R_pdc;
    std::vector<double> M_std, K_std, R_std, R_normal_std; ///< standard deviations, NaN inside; empty: none
    okid_pdc_t pdc{};
    double alpha_std = NAN, beta_std = NAN;
    std::vector<mass_mode> modes;
    int admissible = 0, pairs = 0;
    std::string feedthrough_output; ///< where the misfit is largest, "" without
    double residual = 0, feedthrough = 0, gain = 0, margin = 0, condition = 0;
};

/// The plan as okid_mkr_identify() takes it; `config` points into the rest.
struct mkr_arguments {
    std::vector<std::int32_t> input_dof, output_dof, sensing;
    std::vector<double> input_gain, output_gain;
    okid_mkr_config_t config{};

    mkr_arguments(const mass_plan& plan, double dt);
    mkr_arguments(const mkr_arguments&) = delete;
    mkr_arguments& operator=(const mkr_arguments&) = delete;
};

/// "acceleration" … to okid_sensing_t; anything else is acceleration.
int sensing_of(const std::string& kind);

/// What makes a plan impossible before any data are seen (a degree of freedom left out, no co-located pair); "" if nothing.
std::string plan_fault(const mass_plan& plan);

/// Numbers of `--input-dofs 3` or `--output-dofs 1,2,-3` into the channels; throws (exit 2) naming the option.
void read_dofs(const std::string& option, const std::string& list, const char* noun,
               std::vector<mass_channel>& channels);

/// Take the units of a CSV's columns; says what is converted, throws (exit 2) when a unit contradicts the kind of sensor.
void take_units(const std::vector<std::string>& units, mass_plan& plan, remarks& said);

/// M, K, R and the proportional damping. Throws `failure` (exit 3) when the model cannot give them; what the checks find
/// goes into `said`, with the change of hold, polarity or sensing that would clear it, where there is one.
mass_matrices find_mass_matrices(const okid_identified_t& model, const mass_plan& plan, remarks& said);

/// Matrices that their standard deviations leave open become NaN: of a diagonal entry, twice the deviation is above the root
/// mean square of the diagonal; M or K with one such entry, R with no other. `said` gets the reason ("mkr_undetermined") in
/// place of the causes that were guessed from their signs.
void drop_undetermined(mass_matrices& found, remarks& said);

/// Keys "mkr" and "pdc" of okid.result/1.
void put_mass_json(const mass_matrices& found, nlohmann::ordered_json& result);

/// The matrices with their units and checks, for a person.
std::string mass_text(const mass_matrices& found);

/// The remarks of okid_mkr_t::notes and of the fit of the damping in words, with their numbers.
remarks mass_remarks(const mass_matrices& found);

} // namespace okid_host
