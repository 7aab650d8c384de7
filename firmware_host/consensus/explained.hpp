// SPDX-License-Identifier: MIT
// PURPOSE  what measured forces explain of a mode
#pragma once
#include "consensus.hpp"
#include "levels.hpp"

#include <complex>
#include <vector>

namespace okid_host {

/// How much of a mode's amplitude, block by block, the measured forces explain through its own pole and those of the modes
/// that a block does not part from it, above what as many numbers explain by chance. All of it where the forces excite it,
/// none where a machine does beside them.
/// @param at_rest  else what each record begins with is taken off first
/// @param modes  all that were found
/// @param block  samples
/// @param seen   the mode's amplitude in each block of each record; NaN where a sample is missing
double explained_by_forces(const record_level& level, std::size_t m, std::size_t n_u, bool at_rest,
                           const consensus_mode& mode, const std::vector<consensus_mode>& modes, std::size_t block,
                           const std::vector<std::complex<double>>& seen);

} // namespace okid_host
