// SPDX-License-Identifier: MIT
// PURPOSE    Kalman gain of a model from the residuals W, V of its state equations
// METHOD     P = A P A^T + Q - (A P C^T + S) (C P C^T + R)^-1 (.)^T with [Q S; S^T R] = [W; V] [W; V]^T. S is taken out
//            first, then the doubling iteration squares the closed loop at every step
// REFERENCE  Van Overschee, De Moor, Subspace Identification (1996) 4.4; Chu, Fan, Lin, Wang (2004) for doubling
// NUMERICS   W W^T >= 0 makes the predictor A - K C stable as long as the pair (A, C) is detectable. R has a floor of
//            1e-12 of its diagonal. Some ten steps
// WORKSPACE  kalman_work() doubles; 18 n^3 flop a step
#include "identify/riccati.hpp"

#include "identify/triangular.hpp"
#include "linalg/arena.hpp"

#include <cmath>

namespace okid {
namespace {

using linalg::multiply;
using std::size_t;
constexpr int most_steps = 60;
constexpr double converged = 1e-13;

struct doubling {
    int n;
    double *a{}, *g{}, *h{}, *root{}, *t{}, *z{}, *ha{}, *v{}, *az{}, *spare{}, *solve{};

    doubling(int states, arena& memory) : n(states) {
        const size_t square = static_cast<size_t>(n) * static_cast<size_t>(n);
        for (double** matrix : {&a, &g, &h, &root, &t, &z, &ha, &v, &az, &spare}) *matrix = memory.take<double>(square);
        solve = memory.take<double>(solve_work(n));
    }

    void product(bool ta, bool tb, double alpha, const double* x, const double* y, double beta, double* out) const {
        multiply(ta, tb, n, n, n, alpha, x, n, y, n, beta, out, n);
    }

    /// t <- its Cholesky factor with zeros above.
    bool factor(double* matrix) const {
        if (linalg::cholesky(n, matrix, n) != 0) return false;
        for (int c = 1; c < n; ++c) std::fill(matrix + at(0, c, n), matrix + at(c, c, n), 0.0);
        return true;
    }

    /// a, g, h <- two steps in one; how much h changed, relative to its size. < 0: failure
    double step() {
        double trace = 0;
        for (int k = 0; k < n; ++k) trace += g[at(k, k, n)];
        std::copy(g, g + at(0, n, n), root);
        for (int k = 0; k < n; ++k) root[at(k, k, n)] += 1e-14 * trace / n;
        if (!factor(root)) return -1;
        product(false, false, 1, h, root, 0, spare); // T = I + root^T H root
        product(true, false, 1, root, spare, 0, t);
        for (int k = 0; k < n; ++k) t[at(k, k, n)] += 1;
        if (!factor(t)) return -1;
        for (int c = 0; c < n; ++c) // G (I + H G)^-1 = Z^T Z
            for (int r = 0; r < n; ++r) z[at(r, c, n)] = root[at(c, r, n)];
        solve_lower(n, t, n, z, n, n, solve);
        product(false, false, 1, h, a, 0, ha);
        product(false, false, 1, z, ha, 0, spare);
        std::copy(a, a + at(0, n, n), v); // V = (I + G H)^-1 A
        product(true, false, -1, z, spare, 1, v);
        product(false, true, 1, a, z, 0, az);
        product(false, true, 1, az, az, 1, g);
        product(true, false, 1, ha, v, 0, spare);
        double change = 0, size = 0;
        for (int c = 0; c < n; ++c)
            for (int r = 0; r <= c; ++r) {
                const double more = (spare[at(r, c, n)] + spare[at(c, r, n)]) / 2;
                h[at(r, c, n)] = h[at(c, r, n)] = h[at(r, c, n)] + more;
                change = std::max(change, std::abs(more));
                size = std::max(size, std::abs(h[at(r, c, n)]));
            }
        product(false, false, 1, a, v, 0, spare);
        std::swap(a, spare);
        if (!std::isfinite(size)) return -1;
        return size > 0 ? change / size : 0;
    }
};

struct gain_work {
    double *r, *s, *f, *c, *pc, *solve;

    gain_work(int n, int n_y, arena& memory) {
        const auto z = static_cast<size_t>(n), y = static_cast<size_t>(n_y);
        r = memory.take<double>(y * y);
        s = memory.take<double>(y * z);
        f = memory.take<double>(y * z);
        c = memory.take<double>(y * z);
        pc = memory.take<double>(y * z);
        solve = memory.take<double>(solve_work(n));
    }
};

} // namespace

size_t kalman_work(int n, int n_y) {
    arena memory;
    const doubling unused(n, memory);
    const gain_work also_unused(n, n_y, memory);
    return memory.bytes() / sizeof(double) + 1;
}

bool kalman_gain(const residual_model& m, double* K, double* Re, double* work) {
    arena memory(work);
    doubling d(m.n, memory);
    const gain_work w(m.n, m.n_y, memory);
    const int n = m.n, n_y = m.n_y;
    multiply(false, true, n_y, n_y, m.width, 1, m.V, n_y, m.V, n_y, 0, Re, n_y);
    for (int o = 0; o < n_y; ++o) Re[at(o, o, n_y)] *= 1 + 1e-12;
    std::copy(Re, Re + at(0, n_y, n_y), w.r);
    if (linalg::cholesky(n_y, w.r, n_y) != 0) return false;
    multiply(false, true, n_y, n, m.width, 1, m.V, n_y, m.W, n, 0, w.s, n_y); // S^T
    std::copy(w.s, w.s + at(0, n, n_y), w.f);
    linalg::cholesky_solve(n_y, w.r, n_y, w.f, n_y, n); // (S R^-1)^T
    multiply(true, false, n, m.width, n_y, -1, w.f, n_y, m.V, n_y, 1, m.W, n);
    multiply(false, true, n, n, m.width, 1, m.W, n, m.W, n, 0, d.h, n);
    for (int c = 0; c < n; ++c) // transposed: the filter equation is the dual of the one the iteration solves
        for (int r = 0; r < n; ++r) d.a[at(r, c, n)] = m.A[at(c, r, n)];
    multiply(true, false, n, n, n_y, -1, m.C, n_y, w.f, n_y, 1, d.a, n);
    std::copy(m.C, m.C + at(0, n, n_y), w.c);
    solve_lower(n_y, w.r, n_y, w.c, n_y, n, w.solve);
    multiply(true, false, n, n, n_y, 1, w.c, n_y, w.c, n_y, 0, d.g, n);
    for (int step = 0;; ++step) {
        if (step == most_steps) return false;
        const double change = d.step();
        if (change < 0) return false;
        if (change <= converged) break;
    }
    multiply(false, true, n, n_y, n, 1, d.h, n, m.C, n_y, 0, w.pc, n); // P C^T
    multiply(false, false, n_y, n_y, n, 1, m.C, n_y, w.pc, n, 1, Re, n_y);
    std::copy(Re, Re + at(0, n_y, n_y), w.r);
    if (linalg::cholesky(n_y, w.r, n_y) != 0) return false;
    multiply(true, true, n_y, n, n, 1, w.pc, n, m.A, n, 1, w.s, n_y); // (A P C^T + S)^T
    linalg::cholesky_solve(n_y, w.r, n_y, w.s, n_y, n);
    for (int o = 0; o < n_y; ++o)
        for (int k = 0; k < n; ++k) K[at(k, o, n)] = w.s[at(o, k, n_y)];
    return true;
}

} // namespace okid
