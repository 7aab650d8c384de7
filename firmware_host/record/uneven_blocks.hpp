// SPDX-License-Identifier: MIT
// What blocks of unequal power say of a mode that no measured force moves.
#pragma once
#include "result/deviations.hpp"

#include <vector>

namespace okid_host {

/// Factors of standard deviations, 1 or more.
struct widening {
    double frequency = 1, damping = 1;
};

/// How much less is known than the jackknife by energies says. @param shifts  of a mode without each block; @param shares  of
/// those blocks in the energy; 1 where the blocks do not tell
widening widening_of(const std::vector<mode_shift>& shifts, const std::vector<double>& shares);

} // namespace okid_host
