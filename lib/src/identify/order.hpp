// SPDX-License-Identifier: MIT
// PURPOSE    model order from the singular values of the Hankel matrix
#pragma once

namespace okid {

/// Even order in 2..largest. `clear` tells whether a gap decided (true) or the noise floor (false).
int choose_order(const double* values, int count, int largest, bool& clear);

} // namespace okid
