// SPDX-License-Identifier: MIT
// Shapes over the places that a roving hammer struck, and those of the sensors.
#pragma once

#include "deviations.hpp"

#include <complex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

/// Of every mode one number a place, the largest 1; NaN: not known.
struct placed_shapes {
    std::vector<int> dofs;                      ///< the places, ascending
    std::vector<double> re, im, re_std, im_std; ///< place by place, mode after mode
    std::vector<double> modal_mass;             ///< kg, of each mode's shape as it stands here
    std::vector<double> modal_mass_std;         ///< empty: not known
};

/// Entry of a shape over sensors in SI units, with the sign that the plan gives the sensor.
std::complex<double> in_si(const mass_channel& sensor, std::complex<double> entry);

/// Over the degrees of freedom of sensors, largest entry 1; no modal masses yet. NaN: not measured.
/// @param shapes  of each mode over the sensors. @param sigma  their deviations, or nullptr
/// @param largest  of each mode what its entries were divided by
placed_shapes over_dofs(const std::vector<mass_channel>& sensors,
                        const std::vector<std::vector<std::complex<double>>>& shapes, const deviations* sigma,
                        std::vector<std::complex<double>>& largest);

/// What an entry of "modes" has of them.
void put_shape_json(const placed_shapes& shapes, std::size_t mode, nlohmann::ordered_json& to);

/// A table with a column a mode, for a person. @param shown  of each mode
std::string shapes_text(const placed_shapes& shapes, const double* frequency_hz, const std::vector<bool>& shown);

} // namespace okid_host
