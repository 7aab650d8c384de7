// SPDX-License-Identifier: MIT
// Shapes of sensors that measure different quantities: a velocity stands a quarter of a turn off an acceleration or displacement.
#pragma once
#include <complex>
#include <vector>

namespace okid_host {

using mode_shape = std::vector<std::complex<double>>;

/// Modal phase collinearity: 1 where all entries lie on one line through the origin (Pappa, Elliott, Schenk 1993). Entries whose
/// output is `turned` are turned back by a quarter first; empty: none is.
double shape_collinearity(const mode_shape& shape, const std::vector<bool>& turned);

/// The outputs that measure velocity beside others that do not, out of okid_sensing_t of each; empty: all are of one kind.
std::vector<bool> turned_by(const std::vector<int>& sensing);

/// The outputs that stand a quarter of a turn off the others in all shapes, where turning them back makes shapes real that
/// were not; empty: there are none. Which of both groups measures velocity the shapes do not tell.
std::vector<bool> turned_outputs(const std::vector<mode_shape>& shapes);

} // namespace okid_host
