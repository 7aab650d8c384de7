// SPDX-License-Identifier: MIT
// PURPOSE    a discrete model in modal coordinates, and the hold factors of a pole
// METHOD     eigenvectors of the balanced A; V^-1 B through the SVD of V; holds from phi_1, phi_2 of l = lambda dt
// REFERENCE  paper eq. (99), (117); first hold: with the state z - G2 u the input factor is dt phi_1(l)^2, for
//            phi_1 - phi_2 + e^l phi_2 = phi_1 + (e^l - 1) phi_2 = phi_1 (1 + l phi_2) = phi_1^2
// NUMERICS   V^-1 B loses cond(V) eps; V singular to rounding (a defective pole) is an error. Repeated poles with enough
//            eigenvectors are fine: V need not pair left with right vectors
// WORKSPACE  5 n_z^2 numbers, the backend's; 30 n_z^3 flop
#include "poles.hpp"

#include "exponential.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;
using real = okid_real_t;
using complex = std::complex<double>;

namespace okid {

static constexpr real singular = 32; // times n eps: a double pole with one eigenvector stays below

void poles::lay_out(int inputs, int outputs, int states, arena& memory) {
    n_u = inputs;
    n_y = outputs;
    n_z = states;
    const auto n = static_cast<size_t>(states), u = static_cast<size_t>(inputs), y = static_cast<size_t>(outputs);
    V = memory.take<real>(n * n);
    re = memory.take<real>(n);
    im = memory.take<real>(n);
    scale = memory.take<real>(n);
    input = memory.take<real>(n * u);
    output = memory.take<real>(y * n);
    left = memory.take<real>(n * n);
    values = memory.take<real>(n);
    right = memory.take<real>(n * n);
    spare = memory.take<real>(n * std::max({n, u, y}));
    work = memory.take<real>(std::max(linalg::eigen_work(states), linalg::svd_work(states, states)));
}

void poles::into(const real* x, int cols, real* out) {
    const auto n = static_cast<size_t>(n_z);
    linalg::multiply(true, false, n_z, cols, n_z, 1, left, n_z, x, n_z, 0, spare, n_z);
    for (size_t c = 0; c < static_cast<size_t>(cols); ++c)
        for (size_t i = 0; i < n; ++i) spare[c * n + i] /= values[i];
    linalg::multiply(true, false, n_z, cols, n_z, 1, right, n_z, spare, n_z, 0, out, n_z);
}

okid_status_t poles::find(const okid_model_t& model) {
    const auto n = static_cast<size_t>(n_z), u = static_cast<size_t>(n_u), y = static_cast<size_t>(n_y);
    std::copy(model.A, model.A + n * n, left);
    if (!std::all_of(left, left + n * n, [](real x) { return std::isfinite(x); })) return OKID_ERR_NUMERIC;
    balance(n_z, left, scale);
    if (linalg::eigen(n_z, left, re, im, V, work) != 0) return OKID_ERR_NUMERIC;
    std::copy(V, V + n * n, spare);
    if (linalg::svd(n_z, n_z, spare, left, values, right, work) != 0) return OKID_ERR_NUMERIC;
    const real floor = singular * static_cast<real>(n_z) * std::numeric_limits<real>::epsilon() * values[0];
    if (!(values[n_z - 1] > floor)) return OKID_ERR_NUMERIC;
    condition = values[0] / values[n_z - 1];
    for (size_t c = 0; c < u; ++c)
        for (size_t i = 0; i < n; ++i) input[c * n + i] = model.B[c * n + i] / scale[i];
    into(input, n_u, input); // through the spare: the source is read before the result is written
    if (model.C == nullptr) return OKID_OK;
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < y; ++i) spare[j * y + i] = model.C[j * y + i] * scale[j];
    linalg::multiply(false, false, n_y, n_z, n_z, 1, spare, n_y, V, n_z, 0, output, n_y);
    return OKID_OK;
}

namespace {

/// sum of l^k / (k + first)!, |l| < 1
complex series(complex l, int first) {
    complex term = first == 1 ? 1.0 : 0.5, sum = term;
    for (int k = 1; k < 20; ++k) {
        term *= l / double(k + first);
        sum += term;
    }
    return sum;
}

} // namespace

complex logarithm(complex mu) {
    const double x = std::abs(mu.real()), y = std::abs(mu.imag()), big = std::max(x, y), small = std::min(x, y);
    const double over = (big - 1) * (big + 1) + small * small; // |mu|^2 - 1
    return {std::abs(over) < 0.5 ? std::log1p(over) / 2 : std::log(std::abs(mu)), std::arg(mu)};
}

complex phi_1(complex l) { return std::abs(l) < 1 ? series(l, 1) : (std::exp(l) - 1.0) / l; }

complex phi_2(complex l) { return std::abs(l) < 1 ? series(l, 2) : (std::exp(l) - 1.0 - l) / (l * l); }

complex hold_inverse(complex l, double dt, int32_t hold) {
    const complex once = phi_1(l);
    return 1.0 / (dt * (hold == OKID_HOLD_ZERO ? once : once * once));
}

complex hold_feed(complex l, int32_t hold) {
    if (hold == OKID_HOLD_ZERO) return 0;
    const complex once = phi_1(l);
    return phi_2(l) / (once * once);
}

} // namespace okid
