// SPDX-License-Identifier: MIT
// PURPOSE    upper tail of the F distribution
// METHOD     continued fraction of the incomplete beta function, evaluated by Lentz's method
// REFERENCE  Abramowitz, Stegun (1964) 26.5.8, 26.6.2
// NUMERICS   relative error below 1e-12 for degrees of freedom up to 1e4; the tail itself, not 1 less the rest
// WORKSPACE  none
#pragma once

namespace okid {

/// Probability that F with a and b degrees of freedom (> 0, need not be whole) exceeds x.
double f_upper_tail(double x, double a, double b);

} // namespace okid
