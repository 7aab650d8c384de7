// SPDX-License-Identifier: MIT
// PURPOSE    a discrete model in modal coordinates: its poles, what each input gives them and each output shows of them
#pragma once
#include "linalg/arena.hpp"

#include <okid/mechanics.h>
#include <okid/model.h>

#include <complex>

namespace okid {

/// A = V J V^-1, J of 1 x 1 and 2 x 2 real blocks: a pair k, k+1 has eigenvector V(:,k) + i V(:,k+1) for re[k] + i im[k],
/// im[k] > 0. V and `input` are in balanced states (exponential.hpp); `output` and `input` do not depend on them.
struct poles {
    int n_u, n_y, n_z;
    okid_real_t *V, *re, *im;                          // n_z x n_z, n_z, n_z
    okid_real_t* scale;                                // n_z, powers of two: state = scale * balanced state
    okid_real_t* input;                                // n_z x n_u, V^-1 B
    okid_real_t* output;                               // n_y x n_z, C V
    okid_real_t condition;                             // of V
    okid_real_t *left, *values, *right, *spare, *work; // SVD of V, an n_z x max(n_z, n_u, n_y) spare, backend's work

    void lay_out(int inputs, int outputs, int states, arena& memory);

    /// @return OKID_OK, OKID_ERR_NUMERIC (no convergence, or V is singular to rounding). model.C may be NULL
    okid_status_t find(const okid_model_t& model);

    /// out (n_z x cols) = V^-1 x; x is n_z x cols in balanced states and is kept.
    void into(const okid_real_t* x, int cols, okid_real_t* out);

    bool pair(int k) const { return im[k] > 0; }
    std::complex<double> mu(int k) const { return {double(re[k]), double(im[k])}; }

    /// Modal input of pair k: the residue of an output o and an input c at this pole is shows(o, k) * takes(k, c).
    std::complex<double> takes(int k, int c) const {
        const okid_real_t* x = input + static_cast<std::size_t>(c) * static_cast<std::size_t>(n_z) + k;
        return {double(x[0]) / 2, -double(x[1]) / 2};
    }
    std::complex<double> shows(int o, int k) const {
        const okid_real_t* y = output + static_cast<std::size_t>(k) * static_cast<std::size_t>(n_y) + o;
        return {double(y[0]), double(y[n_y])};
    }
};

/// Principal logarithm, exact near the unit circle. The C library's calls qsort, and with it the allocator.
std::complex<double> logarithm(std::complex<double> mu);

/// (e^l - 1)/l and (e^l - 1 - l)/l^2 without cancellation.
std::complex<double> phi_1(std::complex<double> l);
std::complex<double> phi_2(std::complex<double> l);

/// b_c / b_d for a pole with l = lambda dt (docs/numerics.md, "MKR per mode").
std::complex<double> hold_inverse(std::complex<double> l, double dt, int32_t hold);

/// What the first hold adds to D: D_d = D_c + sum over the poles of c b_d feed(l). Zero for the zero hold.
std::complex<double> hold_feed(std::complex<double> l, int32_t hold);

} // namespace okid
