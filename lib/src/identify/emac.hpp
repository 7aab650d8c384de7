// SPDX-License-Identifier: MIT
// PURPOSE    where along the horizon EMAC compares a mode with its eigenvalue
// REFERENCE  Pappa, Elliott, Schenk (1993), who compare at its end
#pragma once
#include <okid/steps/era.h>
#include <okid/steps/subspace.h>

#include <algorithm>
#include <cmath>

namespace okid {

/// The block row where a mode of this |mu| has fallen to a fiftieth of its amplitude, `last` at most: noise hides what later
/// rows have of it.
inline int telling_row(double size, int last) {
    constexpr double decays = 4;
    return size < 1 ? std::min(last, std::max(1, static_cast<int>(-decays / std::log(size)))) : last;
}

/// okid_subspace_emac() and okid_era_emac().
/// @param while_it_lasts  at telling_row() (SSARX: at the end), else at the end of the horizon
okid_status_t subspace_emac(const okid_subspace_t* self, int32_t order, const okid_real_t* C, const okid_modes_t* modes,
                            okid_real_t* emac, bool while_it_lasts);
okid_status_t era_emac(const okid_era_t* self, int32_t order, const okid_modes_t* modes, okid_real_t* emac,
                       bool while_it_lasts);

} // namespace okid
