// SPDX-License-Identifier: MIT
// PURPOSE  what measured forces explain of a mode
#pragma once
#include "consensus.hpp"
#include "levels.hpp"

#include <complex>
#include <vector>

namespace okid_host {

/// How much of a mode's amplitude, block by block, the measured forces explain through its pole and those of the modes that a
/// block does not part from it. What leaks into the blocks from other modes is taken off first, as is what so many numbers
/// explain by chance. About 1 where the forces excite the mode, 0 where a machine does beside them.
/// @param n_u       at least 1
/// @param rings_on  through a record: what each record begins with is taken off too, and every block counts alike
/// @param modes     all that were found
/// @param block     samples
/// @param seen      the mode's amplitude in each block of each record; NaN where a sample is missing
double explained_by_forces(const record_level& level, std::size_t m, std::size_t n_u, bool rings_on,
                           const consensus_mode& mode, const std::vector<consensus_mode>& modes, std::size_t block,
                           const std::vector<std::complex<double>>& seen);

} // namespace okid_host
