// SPDX-License-Identifier: MIT
// PURPOSE    MOESP and CVA: observability matrix from the LQ factor, A and C from it, K from the residuals of the
//            states
// METHOD     columns of [L31 L32 L33] = Y_f in orthonormal coordinates. Gamma = left singular vectors of L32 (MOESP) or
//            S times those of S^-1 L32 with S S^T = L32 L32^T + L33 L33^T (CVA), made orthonormal: the first n columns
//            serve order n. States X_i = Gamma^T (prediction of Y_f - H U_f), X_(i+1) = Gamma_^+ (the same one sample
//            later, y_i known): their residuals give K
// REFERENCE  paper eq. (68)-(86); Van Overschee, De Moor (1996) 4.3-4.4
// NUMERICS   A = (I - E^T E)^-1 Gamma_^T Gamma-bar, E the last block row of the orthonormal Gamma: no cond(Gamma)^2.
//            One LQ gives both state sequences: [W_p; U_f; y_i] spans what the second projection of N4SID conditions on
// WORKSPACE  2 h top width flop once; an order costs 2 n^3 for A, 2 n a^2 + 2 n^2 width + doubling steps for K
#include "identify/riccati.hpp"
#include "identify/subspace.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using std::size_t;

void projection::lay_out(const subspace_sizes& z, arena& memory) {
    const int n = z.top, p = z.n_y + n;
    width = z.a + z.w + z.n_y;
    gamma = memory.take<double>(area(z.h, n));
    core = memory.take<double>(area(n, n));
    projected = memory.take<double>(area(n, width));
    shifted = memory.take<double>(area(n, width));
    cross = memory.take<double>(area(z.h, z.a));
    autos = memory.take<double>(area(z.a, z.a));
    normal = memory.take<double>(area(n, n));
    powers = memory.take<double>(area(z.h, n));
    theta = memory.take<double>(area(p, z.n_u));
    states = memory.take<double>(area(n, width));
    later = memory.take<double>(area(n, width));
    outputs = memory.take<double>(area(z.n_y, width));
    drive = memory.take<double>(area(n, z.a));
    gain = memory.take<double>(kalman_work(n, z.n_y));
    solve = memory.take<double>(solve_work(std::max(z.h, width)));
    seen = memory.take<double>(area(n, z.i) * static_cast<size_t>(p));
    step = memory.take<double>(2 * area(n, n));
    across = memory.take<double>(area(n, z.i) * static_cast<size_t>(p));
    lagged = memory.take<double>(2 * area(n, n));
    equations = memory.take<double>(area(p * z.n_u, p * z.n_u));
    root = memory.take<double>(std::max({area(p, z.n_u), area(z.i), area(z.n_y)}));
    chunk = memory.take<double>(area(n * chunk_columns, p * z.n_u));
    remainder = memory.take<double>(area(z.h, z.a) + area(n, z.a));
}

okid_status_t projection::decompose(const subspace_sizes& z, bool cva, bool squares, const hankel_factor& f,
                                    rank_cut& cut) {
    const double *L3 = f.L + z.a + z.w, *L32 = L3 + at(0, z.a, f.size), *L33 = L3 + at(0, z.a + z.w, f.size);
    if (cva) {
        lower_product(z.h, [&](int) { return z.w; }, L32, f.size, 0, cut.weight, z.h);
        lower_product(z.h, [](int last) { return last + 1; }, L33, f.size, 1, cut.weight, z.h);
        for (int c = 0; c < z.w; ++c)
            std::copy(L32 + at(0, c, f.size), L32 + at(z.h, c, f.size), cut.source + at(0, c, z.h));
        if (!cut.whiten(z)) return OKID_ERR_NUMERIC;
    }
    if (!cut.decompose(z, cva ? cut.source : L32, cva ? z.h : f.size, squares)) return OKID_ERR_NUMERIC;
    int columns = cut.carried;
    if (cva)
        multiply(false, false, z.h, columns, z.h, 1, cut.weight, z.h, cut.left, z.h, 0, gamma, z.h);
    else
        std::copy(cut.left, cut.left + at(0, columns, z.h), gamma);
    columns = cut.carried = orthonormalise(z.h, columns, gamma, core, z.top);
    if (columns == 0) return OKID_ERR_NUMERIC;
    const int short_h = z.h - z.n_y;
    multiply(true, false, columns, columns, short_h, 1, gamma, z.h, gamma + z.n_y, z.h, 0, core, z.top);
    multiply(true, false, columns, width, z.h, 1, gamma, z.h, L3, f.size, 0, projected, z.top);
    multiply(true, false, columns, width, short_h, 1, gamma, z.h, L3 + z.n_y, f.size, 0, shifted, z.top);
    if (z.n_u == 0) return OKID_OK;
    multiply(false, true, z.h, z.a, z.a, 1, L3, f.size, f.L, f.size, 0, cross, z.h);
    multiply(false, true, z.a, z.a, z.a, 1, f.L, f.size, f.L, f.size, 0, autos, z.a);
    return OKID_OK;
}

okid_status_t projection::realize(const subspace_sizes& z, const hankel_factor& f, int order, bool inputs,
                                  bool with_gain, const state_model& out) const {
    const int n = order;
    const double* E = end(z);
    for (int c = 0; c < n; ++c) {
        std::fill(normal + at(0, c, n), normal + at(n, c, n), 0.0);
        normal[at(c, c, n)] = 1;
        std::copy(core + at(0, c, z.top), core + at(n, c, z.top), out.A + at(0, c, n));
        std::copy(gamma + at(0, c, z.h), gamma + at(z.n_y, c, z.h), out.C + at(0, c, z.n_y));
    }
    multiply(true, false, n, n, z.n_y, -1, E, z.h, E, z.h, 1, normal, n);
    if (linalg::cholesky(n, normal, n) != 0) return OKID_ERR_NUMERIC;
    linalg::cholesky_solve(n, normal, n, out.A, n, n);
    if (z.n_u > 0 && (inputs || with_gain) && !joint_inputs(z, f, n, out)) return OKID_ERR_NUMERIC;
    if (with_gain && !residual_gain(z, f, n, out)) return OKID_ERR_NUMERIC;
    return OKID_OK;
}

/// K and innovation from the residuals of X_(i+1) = A X_i + B u_i, y_i = C X_i + D u_i.
bool projection::residual_gain(const subspace_sizes& z, const hankel_factor& f, int order,
                               const state_model& out) const {
    const int n = order, known = z.a + z.w, p = z.n_y + n;
    const double *L1 = f.L, *y = f.L + known, *E = end(z);
    for (int c = 0; c < width; ++c) {
        std::copy(projected + at(0, c, z.top), projected + at(n, c, z.top), states + at(0, c, n));
        std::copy(shifted + at(0, c, z.top), shifted + at(n, c, z.top), later + at(0, c, n));
        std::copy(y + at(0, c, f.size), y + at(z.n_y, c, f.size), outputs + at(0, c, z.n_y));
    }
    std::fill(states + at(0, known, n), states + at(0, width, n), 0.0); // X_i does not know y_i
    if (z.n_u > 0) {
        multiply(false, false, n * z.i, z.n_u, p, 1, seen, n * z.i, theta, p, 0, drive, n * z.i); // Gamma^T H
        multiply(false, false, n, z.a, z.a, -1, drive, n, L1, f.size, 1, states, n);
        for (int c = 0; c < z.n_u; ++c) // Gamma_^T H one block shorter, from time i + 1 on
            for (int k = z.i - 1; k >= 0; --k) {
                double* column = drive + at(0, c * z.i + k, n);
                if (k == 0) {
                    std::fill(column, column + n, 0.0);
                    continue;
                }
                std::copy(column - n, column, column);
                double* markov = root; // C A^(i-k-1) B, n_y numbers; free by now
                multiply(false, false, z.n_y, 1, n, 1, powers + (z.i - k - 1) * z.n_y, z.h, out.B + at(0, c, n), n, 0,
                         markov, z.n_y);
                multiply(true, false, n, 1, z.n_y, -1, E, z.h, markov, z.n_y, 1, column, n);
            }
        multiply(false, false, n, z.a, z.a, -1, drive, n, L1, f.size, 1, later, n);
    }
    linalg::cholesky_solve(n, normal, n, later, n, width);
    multiply(false, false, n, width, n, -1, out.A, n, states, n, 1, later, n);
    multiply(false, false, z.n_y, width, n, -1, out.C, z.n_y, states, n, 1, outputs, z.n_y);
    for (int c = 0; c < z.n_u; ++c) { // u_i is row c i
        multiply(false, false, n, z.a, 1, -1, out.B + at(0, c, n), n, L1 + c * z.i, f.size, 1, later, n);
        multiply(false, false, z.n_y, z.a, 1, -1, out.D + at(0, c, z.n_y), z.n_y, L1 + c * z.i, f.size, 1, outputs,
                 z.n_y);
    }
    return kalman_gain({n, z.n_y, width, out.A, out.C, later, outputs}, out.K, out.innovation, gain);
}

} // namespace okid
