// SPDX-License-Identifier: MIT
// Records of one structure between which sensors were moved, to one set of modes over all places.
#pragma once
#include "frequency/identify_lags.hpp"

#include <string>
#include <vector>

namespace okid_host {

/// Method auto: each set-up by itself, as its records alone would be, then merged by modes (PoSER); plscf: all together from
/// their correlations (PreGER). `options.outputs`: of all set-ups, `options.inputs`: of each; with degrees of freedom the
/// shapes stand at them, with modal masses where a force and a sensor share one. Throws `failure`.
/// @param references  outputs that stand in every set-up and scale the shapes; empty: all such, or the forces where there is none
record_result identify_set_ups(std::vector<set_up> set_ups, const record_options& options,
                               const std::vector<std::string>& references);

} // namespace okid_host
