// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of A and C of MOESP and CVA by a change of the sums
// METHOD     e = Y_f less its regression on [U_f; W_p], z = the part of W_p in it, U_f taken out: rows P_e, P_z of L33 L^-1 and
//            L32 L^-1. Z = cov(z), W = Z + cov(e) (MOESP: 1); Gamma spans the leading part of Z W^-1. With Gm = W^-1 Gamma
//            and Z Gm = Gamma M the change across Gamma is X = dZ Gm M^-1 + T (dZ Gm - dW Gm M) M^-2 + .., T = Z W^-1 outside
//            Gamma, dZ = P_z dG P_z^T + P_e dG P_z^T + P_z dG P_e^T, dW = dZ + P_e dG P_e^T. Of X only the functionals F
//            are needed that A = Gamma_^+ Gamma-bar and C change with
// REFERENCE  paper eq. (68)-(86); Doehler, Mevel (2013); Reynders, Pintelon, De Roeck (2008); docs/numerics.md, uncertainty
// NUMERICS   the terms left out are of third order in the noise: squares of the singular values left out over those taken
// WORKSPACE  size (6 n_z + 12 n_z + 4 n_y) numbers; size^2 (14 n_z + 4 n_y) flop once, 4 size^2 n_z a change
#include "identify/linear.hpp"

#include <algorithm>

namespace okid {

using linalg::multiply;
using std::size_t;

void linear_subspace::lay_out(const okid_identify& s, int largest, arena& memory) {
    size = s.n;
    n_y = s.n_y;
    h = s.config.rows * n_y;
    functionals = 3 * largest + n_y;
    const int tallest = std::max(4 * functionals, 2 * largest);
    for (double** each : {&dual, &whitened}) *each = memory.take<double>(area(h, largest));
    for (double** each : {&cross, &root, &back, &normal, &pencil, &A})
        *each = memory.take<double>(area(largest, largest));
    for (double** each : {&ask, &next, &turned}) *each = memory.take<double>(area(h, functionals));
    left = memory.take<double>(area(4 * functionals, size));
    right = memory.take<double>(area(size, 2 * largest));
    rows = memory.take<double>(area(tallest, size));
    moved = memory.take<double>(area(size, 2 * largest));
    found = memory.take<double>(area(functionals, largest));
    solve = memory.take<double>(solve_work(std::max({size, tallest, h})));
    C = memory.take<double>(area(n_y, largest));
    out_A = memory.take<okid_real_t>(area(largest, largest));
    out_C = memory.take<okid_real_t>(area(n_y, largest));
}

/// dual = W^-1 Gamma, back = M^-1 = K^-1 J with K = dual^T Z dual, J = dual^T Gamma; root = M.
bool linear_subspace::weigh(bool cva) {
    const subspace_sizes& z = view.sizes;
    const int n = order;
    const double* L32 = view.L + at(z.a + z.w, z.a, size);
    std::copy(view.gamma, view.gamma + at(0, n, h), whitened);
    if (cva) solve_lower(h, view.weight, h, whitened, h, n, solve);
    multiply(true, false, n, n, h, 1, whitened, h, whitened, h, 0, back, n); // J
    for (int k = 0; k < n; ++k)
        for (int r = 0; r < h; ++r) turned[at(k, r, n)] = whitened[at(r, k, h)];
    if (cva) solve_lower_right(h, view.weight, h, turned, n, n, solve);
    for (int k = 0; k < n; ++k)
        for (int r = 0; r < h; ++r) dual[at(r, k, h)] = turned[at(k, r, n)];
    multiply(true, false, n, z.w, h, 1, dual, h, L32, size, 0, rows, n);
    multiply(false, true, n, n, z.w, 1, rows, n, rows, n, 0, root, n); // K
    std::copy(back, back + at(0, n, n), A);
    std::copy(root, root + at(0, n, n), cross);
    if (linalg::cholesky(n, root, n) != 0) return false;
    linalg::cholesky_solve(n, root, n, back, n, n);
    std::copy(cross, cross + at(0, n, n), root);
    std::copy(A, A + at(0, n, n), cross); // J, to be its factor
    if (linalg::cholesky(n, cross, n) != 0) return false;
    linalg::cholesky_solve(n, cross, n, root, n, n);
    return true;
}

/// turned <- (1 - dual J^-1 Gamma^T) turned: twice, for a first time leaves the rounding of the large singular values.
void linear_subspace::leave_gamma() {
    const int n = order, nf = 3 * n + n_y;
    for (int pass = 0; pass < 2; ++pass) {
        multiply(true, false, n, nf, h, 1, view.gamma, h, turned, h, 0, found, n);
        linalg::cholesky_solve(n, cross, n, found, n, nf);
        multiply(false, false, h, nf, n, -1, dual, h, found, n, 1, turned, h);
    }
}

/// ask = F (1 - Gamma J^-1 dual^T): rows of Gamma_, of Gamma_ one block later, of what A leaves of Gamma-bar, of C.
bool linear_subspace::ask_for() {
    const int n = order, nf = 3 * n + n_y, short_h = h - n_y;
    const double* gamma = view.gamma;
    multiply(true, false, n, n, short_h, 1, gamma, h, gamma, h, 0, normal, n);
    multiply(true, false, n, n, short_h, 1, gamma, h, gamma + n_y, h, 0, pencil, n);
    if (linalg::cholesky(n, normal, n) != 0) return false;
    linalg::cholesky_solve(n, normal, n, pencil, n, n);
    std::fill(turned, turned + at(0, nf, h), 0.0);
    for (int k = 0; k < n; ++k) {
        std::copy(gamma + at(0, k, h), gamma + at(short_h, k, h), turned + at(0, k, h));
        std::copy(gamma + at(0, k, h), gamma + at(short_h, k, h), turned + at(n_y, n + k, h));
        std::copy(gamma + at(n_y, k, h), gamma + at(h, k, h), turned + at(0, 2 * n + k, h));
    }
    multiply(false, false, short_h, n, n, -1, gamma, h, pencil, n, 1, turned + at(0, 2 * n, h), h);
    for (int o = 0; o < n_y; ++o) turned[at(o, 3 * n + o, h)] = 1;
    leave_gamma();
    for (int r = 0; r < h; ++r)
        for (int k = 0; k < nf; ++k) ask[at(k, r, nf)] = turned[at(r, k, h)];
    return true;
}

/// Columns in the order of the factor -> of the sums; `to` is count x size, or size x count.
void linear_subspace::to_sums(double* from, int count, double* to, bool transposed) {
    for (int r = 0; r < size; ++r) {
        const int c = view.place[r];
        for (int k = 0; k < count; ++k) to[transposed ? at(c, k, size) : at(k, c, count)] = from[at(k, r, count)];
    }
}

okid_status_t linear_subspace::begin(okid_identify& identifier, const okid_identified_t& full) {
    by = &identifier;
    order = full.n_z;
    view = view_of(by->subspace);
    const subspace_sizes& z = view.sizes;
    const bool cva = view.method == OKID_SUBSPACE_CVA;
    const int n = order, nf = 3 * n + n_y, known = z.a + z.w;
    const double *L32 = view.L + at(known, z.a, size), *L33 = view.L + at(known, known, size);
    if (n > view.carried || !weigh(cva) || !ask_for()) return OKID_ERR_NUMERIC;
    double* past = rows + at(0, z.a, 2 * n); // [dual^T L32; dual^T L33] L^-1
    std::fill(rows, rows + at(0, size, 2 * n), 0.0);
    multiply(true, false, n, z.w, h, 1, dual, h, L32, size, 0, past, 2 * n);
    multiply(true, false, n, h, h, 1, dual, h, L33, size, 0, rows + at(n, known, 2 * n), 2 * n);
    solve_lower_right(size, view.L, size, rows, 2 * n, 2 * n, solve);
    to_sums(rows, 2 * n, right, true);
    const int all = 4 * nf; // [ask L32; next L32; ask L33; next L33] L^-1, next = ask Z W^-1
    std::fill(rows, rows + at(0, size, all), 0.0);
    past = rows + at(0, z.a, all);
    double* future = rows + at(2 * nf, known, all);
    multiply(false, false, nf, z.w, h, 1, ask, nf, L32, size, 0, past, all);
    multiply(false, true, nf, h, z.w, 1, past, all, L32, size, 0, next, nf);
    if (cva) {
        for (int r = 0; r < h; ++r)
            for (int k = 0; k < nf; ++k) turned[at(r, k, h)] = next[at(k, r, nf)];
        solve_lower(h, view.weight, h, turned, h, nf, solve);
        for (int r = 0; r < h; ++r)
            for (int k = 0; k < nf; ++k) next[at(k, r, nf)] = turned[at(r, k, h)];
        solve_lower_right(h, view.weight, h, next, nf, nf, solve);
    }
    for (int r = 0; r < h; ++r) // next Gamma = ask Gamma M = 0
        for (int k = 0; k < nf; ++k) turned[at(r, k, h)] = next[at(k, r, nf)];
    leave_gamma();
    for (int r = 0; r < h; ++r)
        for (int k = 0; k < nf; ++k) next[at(k, r, nf)] = turned[at(r, k, h)];
    multiply(false, false, nf, z.w, h, 1, next, nf, L32, size, 0, past + nf, all);
    multiply(false, false, nf, h, h, 1, ask, nf, L33, size, 0, future, all);
    multiply(false, false, nf, h, h, 1, next, nf, L33, size, 0, future + nf, all);
    solve_lower_right(size, view.L, size, rows, all, all, solve);
    to_sums(rows, all, left, false);
    for (int c = 0; c < size; ++c)
        for (int r = 0; r < 2 * nf; ++r) left[at(2 * nf + r, c, all)] += left[at(r, c, all)]; // z + e
    return OKID_OK;
}

/// found <- (z + e of ask) P + z Q of ask, P = G z' M^-1, Q = G e' M^-1, and of next with P M^-1, for CVA less P + Q, and Q M^-1.
okid_model_t linear_subspace::along(double step) {
    const int n = order, nf = 3 * n + n_y, all = 4 * nf;
    const size_t one = area(size, n);
    double *P = rows, *Q = P + one, *later_P = Q + one, *later_Q = later_P + one;
    multiply(false, false, size, n, n, 1, moved, size, back, n, 0, P, size);
    multiply(false, false, size, n, n, 1, moved + one, size, back, n, 0, Q, size);
    if (view.method == OKID_SUBSPACE_CVA)
        for (size_t k = 0; k < one; ++k) later_P[k] = -(P[k] + Q[k]);
    else
        std::fill(later_P, later_P + one, 0.0);
    multiply(false, false, size, n, n, 1, P, size, back, n, 1, later_P, size);
    multiply(false, false, size, n, n, 1, Q, size, back, n, 0, later_Q, size);
    multiply(false, false, nf, n, size, 1, left, all, Q, size, 0, found, nf);
    multiply(false, false, nf, n, size, 1, left + nf, all, later_Q, size, 1, found, nf);
    multiply(false, false, nf, n, size, 1, left + 2 * nf, all, P, size, 1, found, nf);
    multiply(false, false, nf, n, size, 1, left + 3 * nf, all, later_P, size, 1, found, nf);
    for (int k = 0; k < n; ++k)
        for (int r = 0; r < n; ++r) A[at(r, k, n)] = found[at(n + r, k, nf)] + found[at(2 * n + k, r, nf)];
    multiply(false, false, n, n, n, -1, found, nf, pencil, n, 1, A, n);
    linalg::cholesky_solve(n, normal, n, A, n, n);
    for (int k = 0; k < n; ++k) {
        for (int r = 0; r < n; ++r)
            out_A[at(r, k, n)] = static_cast<okid_real_t>(pencil[at(r, k, n)] + step * A[at(r, k, n)]);
        for (int o = 0; o < n_y; ++o)
            out_C[at(o, k, n_y)] =
                static_cast<okid_real_t>(view.gamma[at(o, k, h)] + step * found[at(3 * n + o, k, nf)]);
    }
    return {by->n_u, n_y, n, out_A, by->B, out_C, by->D, nullptr};
}

} // namespace okid
