// SPDX-License-Identifier: MIT
// PURPOSE    SSARX: states by canonical correlation of the past with future outputs that an ARX model has corrected
// METHOD     one LQ factor of the Hankel rows by time. y_i on [W_p; u_i]: ARX model of i lags. Its part in the future
//            samples is taken from Y_f: row a is y_(i+a) - D u_(i+a) - sum over h = 1..a of Ybar_h v_(i+a-h). SVD of
//            S^-1 F21 with S S^T = cov(Ytilde_f); x_i = Sigma^(1/2) V^T F11^-1 W_p, x_(i+1) the same of the rows one
//            sample later. y_i on [x_i; u_i] gives C, D; x_(i+1) on [x_i; u_i] A, B; residuals K
// REFERENCE  Jansson (2003) for the method (the paper names it without equations, trap 8);
//            docs/numerics.md, "Subspace methods"
// NUMERICS   the coordinates of the past are orthonormal, so that the states are too and one set of products serves
//            every order. F11 is singular without noise: the ridge of the factor bounds what is read through it
// WORKSPACE  n_y m i^2 w + h^2 w flop once, an order 4 n_z m w
#include "identify/riccati.hpp"
#include "identify/subspace.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using std::size_t;

namespace {

constexpr double excitation_floor = 1e-13;

/// X <- (Cholesky factor of G) solve; G (n x n, lower) gets a small floor. false: not positive
bool solve_symmetric(int n, double* g, double* x, int count) {
    for (int k = 0; k < n; ++k) g[at(k, k, n)] *= 1 + excitation_floor;
    if (linalg::cholesky(n, g, n) != 0) return false;
    linalg::cholesky_solve(n, g, n, x, n, count);
    return true;
}

} // namespace

void ssarx::lay_out(const subspace_sizes& z, arena& memory) {
    const int n = z.top;
    width = z.w + z.m;
    theta = memory.take<double>(area(z.n_y, z.w + z.n_u));
    toeplitz = memory.take<double>(area(z.h, z.w));
    corrected = memory.take<double>(area(z.h, 2 * z.w));
    basis = memory.take<double>(area(z.w, n));
    next = memory.take<double>(area(n, width));
    core = memory.take<double>(area(n, n));
    seen = memory.take<double>(area(z.n_y, n));
    driven = memory.take<double>(area(z.n_u, n));
    end = memory.take<double>(area(z.n_y, n));
    force = memory.take<double>(area(z.n_u, width));
    square = memory.take<double>(area(z.n_u, z.n_u) + area(z.n_u, z.n_y) + area(z.n_u, n));
    output = memory.take<double>(area(z.n_y, width));
    later = memory.take<double>(area(n, width));
    beside = memory.take<double>(area(z.a, n) + area(z.a, z.n_y) + area(z.a, 2 * z.w));
    beside_square = memory.take<double>(area(z.a, z.a));
    gain = memory.take<double>(kalman_work(n, z.n_y));
}

void fill_correction(const subspace_sizes& z, const double* theta, double* out) {
    std::fill(out, out + at(0, z.w, z.h), 0.0);
    for (int a = 0; a < z.i; ++a)
        for (int lag = 0; lag <= a; ++lag) // v_(i+a-lag); lag 0 is u alone
            for (int c = 0; c < (lag == 0 ? z.n_u : z.m); ++c) {
                const double* from = theta + at(0, (z.i - lag) * z.m + c, z.n_y);
                double* to = out + at(a * z.n_y, (a - lag) * z.m + c, z.h);
                for (int o = 0; o < z.n_y; ++o) to[o] = -from[o];
            }
}

/// theta, then corrected = T [future rows of L], in strips of some 64 rows as far as they reach.
void ssarx::correct(const subspace_sizes& z, const hankel_factor& f, double* solve) const {
    const int q = z.w + z.n_u;
    for (int c = 0; c < q; ++c)
        std::copy(f.L + at(q, c, f.size), f.L + at(q + z.n_y, c, f.size), theta + at(0, c, z.n_y));
    solve_lower_right(q, f.L, f.size, theta, z.n_y, z.n_y, solve);
    fill_correction(z, theta, toeplitz);
    for (int a = 0; a < z.i; ++a)
        for (int o = 0; o < z.n_y; ++o) toeplitz[at(a * z.n_y + o, a * z.m + z.n_u + o, z.h)] = 1;
    std::fill(corrected, corrected + at(0, 2 * z.w, z.h), 0.0); // sums over rows of different reach read beyond it
    const int blocks = std::max(1, 64 / z.n_y);
    for (int a = 0; a < z.i; a += blocks) {
        const int last = std::min(z.i, a + blocks), reach = last * z.m;
        multiply(false, false, (last - a) * z.n_y, z.w + reach, reach, 1, toeplitz + a * z.n_y, z.h, f.L + z.w, f.size,
                 0, corrected + a * z.n_y, z.h);
    }
}

okid_status_t ssarx::decompose(const subspace_sizes& z, bool squares, const hankel_factor& f, rank_cut& cut) const {
    correct(z, f, cut.solve);
    lower_product(z.h, [&](int row) { return z.w + (row / z.n_y + 1) * z.m; }, corrected, z.h, 0, cut.weight, z.h);
    std::copy(corrected, corrected + at(0, z.w, z.h), cut.source);
    if (!cut.whiten(z) || !cut.decompose(z, cut.source, z.h, squares)) return OKID_ERR_NUMERIC;
    const int orders = cut.carried = orthonormalise(z.w, cut.carried, cut.right, core, z.top);
    if (orders == 0) return OKID_ERR_NUMERIC;
    double* J = later; // of orders: V^T F11^-1
    for (int c = 0; c < z.w; ++c)
        for (int k = 0; k < orders; ++k) basis[at(c, k, z.w)] = J[at(k, c, z.top)] = cut.right[at(c, k, z.w)];
    solve_lower_right(z.w, f.L, f.size, J, z.top, orders, cut.solve);
    multiply(false, false, orders, width, z.w, 1, J, z.top, f.L + z.m, f.size, 0, next, z.top);
    multiply(false, false, orders, orders, z.w, 1, next, z.top, basis, z.w, 0, core, z.top);
    multiply(false, false, z.n_y, orders, z.w, 1, f.L + z.w + z.n_u, f.size, basis, z.w, 0, seen, z.n_y);
    if (z.n_u > 0) multiply(false, false, z.n_u, orders, z.w, 1, f.L + z.w, f.size, basis, z.w, 0, driven, z.n_u);
    return last_block(z, f, orders) ? OKID_OK : OKID_ERR_NUMERIC;
}

/// Last block row of the observability matrix: y_(2i-1) on the states and the future inputs.
bool ssarx::last_block(const subspace_sizes& z, const hankel_factor& f, int orders) const {
    const double* y = f.L + 2 * z.w - z.n_y;
    multiply(false, false, z.n_y, orders, z.w, 1, y, f.size, basis, z.w, 0, end, z.n_y);
    if (z.n_u == 0) return true;
    double *ux = beside, *uy = ux + at(0, orders, z.a), *u = uy + at(0, z.n_y, z.a);
    for (int c = 0; c < 2 * z.w; ++c)
        for (int k = 0; k < z.i; ++k)
            for (int r = 0; r < z.n_u; ++r) u[at(k * z.n_u + r, c, z.a)] = f.L[at(z.w + k * z.m + r, c, f.size)];
    multiply(false, false, z.a, orders, z.w, 1, u, z.a, basis, z.w, 0, ux, z.a);
    multiply(false, true, z.a, z.n_y, 2 * z.w, 1, u, z.a, y, f.size, 0, uy, z.a);
    multiply(false, true, z.a, z.n_y, orders, -1, ux, z.a, end, z.n_y, 1, uy, z.a);
    multiply(false, true, z.a, z.a, 2 * z.w, 1, u, z.a, u, z.a, 0, beside_square, z.a);
    multiply(false, true, z.a, z.a, orders, -1, ux, z.a, ux, z.a, 1, beside_square, z.a);
    if (!solve_symmetric(z.a, beside_square, uy, z.n_y)) return false;
    multiply(true, false, z.n_y, orders, z.a, -1, uy, z.a, ux, z.a, 1, end, z.n_y);
    return true;
}

okid_status_t ssarx::realize(const subspace_sizes& z, const hankel_factor& f, int order, bool with_gain,
                             const state_model& out) const {
    const int n = order;
    const double *u = f.L + z.w, *y = u + z.n_u;
    double *uy = square + at(0, z.n_u, z.n_u), *ux = uy + at(0, z.n_y, z.n_u);
    for (int c = 0; c < n; ++c) {
        std::copy(core + at(0, c, z.top), core + at(n, c, z.top), out.A + at(0, c, n));
        std::copy(seen + at(0, c, z.n_y), seen + at(z.n_y, c, z.n_y), out.C + at(0, c, z.n_y));
    }
    if (z.n_u > 0) { // u_i less its part in the states; what y_i and x_(i+1) have of it is D and B
        for (int c = 0; c < width; ++c)
            std::copy(u + at(0, c, f.size), u + at(z.n_u, c, f.size), force + at(0, c, z.n_u));
        multiply(false, true, z.n_u, z.w, n, -1, driven, z.n_u, basis, z.w, 1, force, z.n_u);
        multiply(false, true, z.n_u, z.n_u, width, 1, force, z.n_u, force, z.n_u, 0, square, z.n_u);
        multiply(false, true, z.n_u, z.n_y, width, 1, force, z.n_u, y, f.size, 0, uy, z.n_u);
        multiply(false, true, z.n_u, n, width, 1, force, z.n_u, next, z.top, 0, ux, z.n_u);
        if (!solve_symmetric(z.n_u, square, uy, z.n_y + n)) return OKID_ERR_NUMERIC;
        for (int c = 0; c < z.n_u; ++c) {
            for (int o = 0; o < z.n_y; ++o) out.D[at(o, c, z.n_y)] = uy[at(c, o, z.n_u)];
            for (int k = 0; k < n; ++k) out.B[at(k, c, n)] = ux[at(c, k, z.n_u)];
        }
        multiply(false, false, z.n_y, n, z.n_u, -1, out.D, z.n_y, driven, z.n_u, 1, out.C, z.n_y);
        multiply(false, false, n, n, z.n_u, -1, out.B, n, driven, z.n_u, 1, out.A, n);
    }
    if (!with_gain) return OKID_OK;
    for (int c = 0; c < width; ++c) {
        std::copy(y + at(0, c, f.size), y + at(z.n_y, c, f.size), output + at(0, c, z.n_y));
        std::copy(next + at(0, c, z.top), next + at(n, c, z.top), later + at(0, c, n));
    }
    multiply(false, true, z.n_y, z.w, n, -1, out.C, z.n_y, basis, z.w, 1, output, z.n_y);
    multiply(false, true, n, z.w, n, -1, out.A, n, basis, z.w, 1, later, n);
    if (z.n_u > 0) {
        multiply(false, false, z.n_y, width, z.n_u, -1, out.D, z.n_y, u, f.size, 1, output, z.n_y);
        multiply(false, false, n, width, z.n_u, -1, out.B, n, u, f.size, 1, later, n);
    }
    return kalman_gain({n, z.n_y, width, out.A, out.C, later, output}, out.K, out.innovation, gain) ? OKID_OK
                                                                                                    : OKID_ERR_NUMERIC;
}

} // namespace okid
