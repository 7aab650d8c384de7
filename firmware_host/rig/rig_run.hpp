// SPDX-License-Identifier: MIT
// A rig at work: forces, response, sensor noise and converters, as integer codes with their scale.
#pragma once
#include "rig.hpp"

namespace okid_host {

struct rig_channel {
    std::string name;   ///< "force1", "acc3": the number is the degree of freedom
    std::string signal; ///< the same in the DBC: "Force1", "Accel3"
    std::string role, unit;
    int dof = 0;
    double scale = 1; ///< value = scale * code
    std::vector<std::int32_t> codes;

    double value(std::size_t n) const { return scale * codes[n]; }
};

struct rig_run {
    double rate_hz = 0;
    int bits = 16;
    std::size_t count = 0, forces = 0;
    std::vector<rig_channel> channels; ///< forces, then outputs
};

/// Forces of a rig before conversion, inputs x count.
Eigen::MatrixXd rig_forces(const rig& rig, std::size_t count);

/// Play the rig. The structure feels the forces as converted (they leave a DAC), so the record's input is exact; noise is
/// white, sigma = noise_percent of each output's rms. Without excitation it swings freely from random first velocities.
rig_run simulate_rig(const rig& rig);

/// One record of a roving hammer: one hit at one of the forces, from rest, all with one name for the force: "hammer".
/// @param place  in force_dofs  @param number  of the hit there: each has its own strength and noise
rig_run simulate_hit(rig rig, std::size_t place, int number);

} // namespace okid_host
