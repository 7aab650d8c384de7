// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of a SSARX model by a change of the sums
// METHOD     in coordinates q of the samples with unit covariance: past q_1, corrected future Y = T q with T T^T = S, states
//            V^T q_1, V spanning the leading part of R = T_1^T S^-1 T_1, R V = V M, O = T_1 V. The change across V is
//            X = dR V M^-1 + R (dR V) M^-2 + .. outside V, with dR V = - dG_11 V M + (dT_1)^T S^-1 O + T_1^T S^-1 (dT_1 V - dS S^-1 O)
//            and dT = T dG + dT(d theta) L_f, theta the ARX model, d theta = (dG_y. - theta dG_..) G_..^-1. Of X only the
//            functionals F are needed that the regression of [x_(i+1); y_i] on [x_i; u_i] changes with
// REFERENCE  Jansson (2003); Doehler, Mevel (2013); docs/numerics.md, uncertainty
// NUMERICS   the terms left out are of third order in the noise: squares of the canonical correlations left out over those taken
// WORKSPACE  size (18 n_z + 8 (n_u + n_y)) numbers; a change takes 2 size^2 (3 n_z + n_u + n_y) + 12 size n_z^2 + 2 h w n_z flop
#include "identify/linear.hpp"

#include <algorithm>

namespace okid {

using linalg::multiply;
using std::size_t;

void linear_ssarx::lay_out(const okid_identify& s, int largest, arena& memory) {
    const int n_u = s.n_u, n_y = s.n_y, most_known = largest + n_u, most_left = largest + n_y;
    size = s.n;
    const int w = size / 2, h = s.config.rows * n_y, ask = 2 * (most_known + n_u + most_left);
    moved = memory.take<double>(area(size, 2 * largest + most_known + n_y));
    right = memory.take<double>(area(size, 2 * largest + most_known + n_y));
    known = memory.take<double>(area(most_known, size));
    left = memory.take<double>(area(most_left, size));
    for (double** each : {&turn, &across}) *each = memory.take<double>(area(largest, size));
    for (double** each : {&past, &future, &spare}) *each = memory.take<double>(area(std::max(ask, most_left), size));
    phi = memory.take<double>(area(w, ask));
    omega = memory.take<double>(area(h, ask));
    reach = memory.take<double>(area(w, ask));
    for (double** each : {&dual, &shifted}) *each = memory.take<double>(area(h, largest));
    for (double** each : {&drive, &turned}) *each = memory.take<double>(area(w, largest));
    toeplitz = memory.take<double>(area(h, w));
    arx = memory.take<double>(area(w + n_u, 2 * n_y));
    found = memory.take<double>(area(ask, largest));
    normal = memory.take<double>(area(most_known, most_known));
    for (double** each : {&regression, &change, &solved}) *each = memory.take<double>(area(most_left, most_known));
    level = memory.take<double>(area(largest));
    solve = memory.take<double>(solve_work(std::max({size, ask, most_left, most_known})));
    A = memory.take<okid_real_t>(area(largest, largest));
    B = memory.take<okid_real_t>(area(largest, n_u));
    C = memory.take<okid_real_t>(area(n_y, largest));
    D = memory.take<okid_real_t>(area(n_y, n_u));
}

/// known = [x_i; u_i], left = [x_(i+1); y_i] less their regression on it, all by q.
bool linear_ssarx::regress() {
    const subspace_sizes& z = view.sizes;
    const int n = order, k = n + z.n_u, e = n + z.n_y;
    std::fill(known, known + area(k, size), 0.0);
    std::fill(left, left + area(e, size), 0.0);
    for (int c = 0; c < z.w + z.m; ++c) {
        const double* sample = view.L + at(z.w, c, size); // u_i, y_i
        for (int r = 0; r < n && c < z.w; ++r) known[at(r, c, k)] = view.basis[at(c, r, z.w)];
        std::copy(sample, sample + z.n_u, known + at(n, c, k));
        std::copy(view.next + at(0, c, z.top), view.next + at(n, c, z.top), left + at(0, c, e));
        std::copy(sample + z.n_u, sample + z.m, left + at(n, c, e));
    }
    multiply(false, true, k, k, size, 1, known, k, known, k, 0, normal, k);
    if (linalg::cholesky(k, normal, k) != 0) return false;
    multiply(false, true, k, e, size, 1, known, k, left, e, 0, solved, k);
    linalg::cholesky_solve(k, normal, k, solved, k, e);
    for (int r = 0; r < e; ++r)
        for (int c = 0; c < k; ++c) regression[at(r, c, e)] = solved[at(c, r, k)];
    multiply(false, false, e, size, k, -1, regression, e, known, k, 1, left, e);
    return true;
}

/// phi = F and R F, outside V: what the change of x_(i+1) and of x_i meets [x_i; u_i] with, and that of x_i what is left.
/// omega = S^-1 T_1 phi.
void linear_ssarx::ask_for() {
    const subspace_sizes& z = view.sizes;
    const int n = order, k = n + z.n_u, e = n + z.n_y, nf = k + z.n_u + e;
    multiply(false, true, z.w, k, size, 1, view.L + z.m, size, known, k, 0, phi, z.w);
    solve_lower(z.w, view.L, size, phi, z.w, k, solve);
    for (int r = 0; r < z.w; ++r) {
        for (int c = 0; c < z.n_u; ++c) phi[at(r, k + c, z.w)] = known[at(n + c, r, k)];
        for (int c = 0; c < e; ++c) phi[at(r, k + z.n_u + c, z.w)] = left[at(c, r, e)];
    }
    multiply(true, false, n, nf, z.w, 1, view.basis, z.w, phi, z.w, 0, found, n);
    multiply(false, false, z.w, nf, n, -1, view.basis, z.w, found, n, 1, phi, z.w);
    for (int term = 0; term < 2; ++term) {
        double *from = phi + at(0, term * nf, z.w), *to = omega + at(0, term * nf, z.h);
        multiply(false, false, z.h, nf, z.w, 1, view.corrected, z.h, from, z.w, 0, to, z.h);
        linalg::cholesky_solve(z.h, view.weight, z.h, to, z.h, nf);
        if (term == 0)
            multiply(true, false, z.w, nf, z.h, 1, view.corrected, z.h, to, z.h, 0, phi + at(0, nf, z.w), z.w);
    }
}

/// Rows by q -> by the rows of the sums, or columns.
void linear_ssarx::to_sums(double* rows, int count, double* to, bool transposed) {
    solve_lower_right(size, view.L, size, rows, count, count, solve);
    for (int r = 0; r < size; ++r)
        for (int k = 0; k < count; ++k)
            to[transposed ? at(view.place[r], k, size) : at(k, view.place[r], count)] = rows[at(k, r, count)];
}

okid_status_t linear_ssarx::begin(okid_identify& identifier, const okid_identified_t& full) {
    by = &identifier;
    order = full.n_z;
    view = view_of(by->subspace);
    const subspace_sizes& z = view.sizes;
    const int n = order, k = n + z.n_u, e = n + z.n_y, all = 2 * (k + z.n_u + e), q = z.w + z.n_u;
    if (n > view.carried || !regress()) return OKID_ERR_NUMERIC;
    ask_for();
    multiply(false, false, z.h, n, z.w, 1, view.corrected, z.h, view.basis, z.w, 0, dual, z.h);
    std::copy(dual, dual + area(z.h, n), shifted);
    linalg::cholesky_solve(z.h, view.weight, z.h, dual, z.h, n);
    multiply(true, false, n, size, z.h, 1, dual, z.h, view.corrected, z.h, 0, turn, n);
    for (int r = 0; r < n; ++r) {
        level[r] = 0;
        for (int o = 0; o < z.h; ++o) level[r] += dual[at(o, r, z.h)] * shifted[at(o, r, z.h)];
        for (int c = 0; c < size; ++c) {
            const double state = c < z.w ? view.basis[at(c, r, z.w)] : 0, seen = turn[at(r, c, n)];
            turn[at(r, c, n)] = seen - level[r] * state;
            across[at(r, c, n)] = state - seen;
        }
    }
    std::fill(past, past + area(all, size), 0.0);
    for (int c = 0; c < z.w; ++c)
        for (int r = 0; r < all; ++r) past[at(r, c, all)] = phi[at(c, r, z.w)];
    multiply(true, false, all, size, z.h, 1, omega, z.h, view.corrected, z.h, 0, future, all);
    for (size_t i = 0; i < area(all, size); ++i) spare[i] = past[i] - future[i];
    multiply(false, true, z.w, all, size, 1, view.L + z.w, size, spare, all, 0, reach, z.w);
    multiply(false, true, z.w, n, size, 1, view.L + z.w, size, across, n, 0, drive, z.w);
    to_sums(turn, n, right, true);
    to_sums(across, n, right + area(size, n), true);
    to_sums(known, k, right + area(size, 2 * n), true);
    double* one_step = right + area(size, 2 * n + k); // of the ARX model: y_i - theta [..]
    std::fill(one_step, one_step + area(size, z.n_y), 0.0);
    for (int o = 0; o < z.n_y; ++o) {
        for (int c = 0; c < q; ++c) one_step[at(view.place[c], o, size)] = -view.theta[at(o, c, z.n_y)];
        one_step[at(view.place[q + o], o, size)] = 1;
    }
    std::copy(past, past + area(all, size), spare);
    to_sums(spare, all, past, false);
    std::copy(future, future + area(all, size), spare);
    to_sums(spare, all, future, false);
    std::copy(left, left + area(e, size), spare);
    to_sums(spare, e, left, false);
    return OKID_OK;
}

/// found <- functionals of dR V, all x n.
void linear_ssarx::change_of_states() {
    const subspace_sizes& z = view.sizes;
    const int n = order, k = n + z.n_u, all = 2 * (k + z.n_u + n + z.n_y), q = z.w + z.n_u;
    const double* one_step = moved + area(size, 2 * n + k);
    double* theta = arx + area(q, z.n_y);
    for (int o = 0; o < z.n_y; ++o)
        for (int c = 0; c < q; ++c) arx[at(c, o, q)] = one_step[at(view.place[c], o, size)];
    linalg::cholesky_solve(q, view.L, size, arx, q, z.n_y);
    for (int o = 0; o < z.n_y; ++o)
        for (int c = 0; c < q; ++c) theta[at(o, c, z.n_y)] = arx[at(c, o, q)];
    fill_correction(z, theta, toeplitz);
    multiply(true, false, z.w, n, z.h, 1, toeplitz, z.h, dual, z.h, 0, turned, z.w);
    multiply(false, false, z.h, n, z.w, 1, toeplitz, z.h, drive, z.w, 0, shifted, z.h);
    multiply(false, false, all, n, size, 1, past, all, moved, size, 0, found, all);
    multiply(false, false, all, n, size, 1, future, all, moved + area(size, n), size, 1, found, all);
    multiply(true, false, all, n, z.w, 1, reach, z.w, turned, z.w, 1, found, all);
    multiply(true, false, all, n, z.h, 1, omega, z.h, shifted, z.h, 1, found, all);
}

okid_model_t linear_ssarx::along(double step) {
    const subspace_sizes& z = view.sizes;
    const int n = order, k = n + z.n_u, e = n + z.n_y, nf = k + z.n_u + e, all = 2 * nf;
    change_of_states();
    for (int r = 0; r < n; ++r)
        for (int f = 0; f < nf; ++f)
            found[at(f, r, all)] = (found[at(f, r, all)] + found[at(nf + f, r, all)] / level[r]) / level[r];
    multiply(false, false, e, k, size, 1, left, e, moved + area(size, 2 * n), size, 0, change, e);
    for (int r = 0; r < n; ++r) {
        for (int c = 0; c < k; ++c) change[at(r, c, e)] += found[at(c, r, all)];
        for (int i = 0; i < e; ++i) change[at(i, r, e)] += found[at(k + z.n_u + i, r, all)];
    }
    multiply(false, true, e, z.n_u, n, -1, regression, e, found + k, all, 1, change + at(0, n, e), e);
    for (int r = 0; r < e; ++r)
        for (int c = 0; c < k; ++c) solved[at(c, r, k)] = change[at(r, c, e)];
    linalg::cholesky_solve(k, normal, k, solved, k, e);
    const auto entry = [&](int r, int c) {
        return static_cast<okid_real_t>(regression[at(r, c, e)] + step * solved[at(c, r, k)]);
    };
    for (int c = 0; c < k; ++c) {
        for (int r = 0; r < n; ++r) (c < n ? A[at(r, c, n)] : B[at(r, c - n, n)]) = entry(r, c);
        for (int o = 0; o < z.n_y; ++o) (c < n ? C[at(o, c, z.n_y)] : D[at(o, c - n, z.n_y)]) = entry(n + o, c);
    }
    return {z.n_u, z.n_y, n, A, B, C, D, nullptr};
}

} // namespace okid
