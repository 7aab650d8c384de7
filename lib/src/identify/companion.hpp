// SPDX-License-Identifier: MIT
// PURPOSE    spectral radius of the companion matrix of an ARX model, without forming it
#pragma once
#include "linalg/arena.hpp"

#include <okid/types.h>

namespace okid {

struct companion_work {
    okid_real_t *basis, *hessenberg, *vectors, *re, *im, *eigen, *feedback;
    int dimension;
    void lay_out(int n_y, int p, arena& memory);
};

/// The part of theta that feeds outputs back, [theta^y_1 .. theta^y_p] side by side: n_y x p n_y.
void take_feedback(int n_u, int n_y, int p, const okid_real_t* theta, okid_real_t* out);

/// Largest |eigenvalue| of y_n = sum_h theta^y_h y_(n-h), theta as okid_observer_solve() gives it, or its growth over 64
/// samples where that is above 1.0005 both as the outputs are and with each in units of 1/scale, its own size. Companions
/// of up to 64 states are solved densely, larger ones by Arnoldi with thick restarts until the dominant Ritz pair has a
/// residual below 1e-7 (6e-6 in float), at most 24 rounds.
/// @param scale         n_y numbers > 0, float or double
/// @param growth_alone  beyond 64 states 0 in place of a radius of what does not grow
template <class Scale>
double companion_radius(int n_u, int n_y, int p, const okid_real_t* theta, const Scale* scale, bool growth_alone,
                        companion_work& work);

} // namespace okid
