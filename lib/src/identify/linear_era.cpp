// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of an okid-era model by a change of the sums
// METHOD     d theta = (dG_yv - theta dG_vv) (V V^T)^-1; Markov parameters by the linearised recursion (40); the pencil in
//            the singular subspaces U, V of H(0): A = (U^T H(0) V)^-1 U^T H(1) V, B = (U^T H(0) V)^-1 U^T H(0) E_u,
//            C = E_y^T H(0) V, with dU S = (1 - U U^T)(dH V + H dV), dV S = (1 - V V^T)(dH^T U + H^T dU), two terms each
// REFERENCE  paper eq. (39), (40), (43)-(54); Doehler, Mevel (2013); docs/numerics.md, uncertainty
// NUMERICS   what the third term of dU, dV would add is of third order in the noise (singular values left out over those taken)
// WORKSPACE  Hankel matrix, 4 (h + b) n_z; a change takes 2 n^2 n_y + 2 q^2 n_y + 4 last p n_y^2 n_u + 4 h b n_z flop
#include "identify/linear.hpp"

#include <algorithm>

namespace okid {

using linalg::multiply;
using std::size_t;
using real = okid_real_t;

namespace {

size_t area(int rows, int cols) { return static_cast<size_t>(rows) * static_cast<size_t>(cols); }

/// Place of regressor k of theta among the rows of the Gram matrix.
int row_of(const okid_observer_config_t& c, int k) { return k < c.n_u ? k : k + c.n_y; }

} // namespace

void linear_era::lay_out(const okid_identify& s, int largest, arena& memory) {
    observer = s.observer_config;
    n = s.n;
    q = s.q;
    rows = s.config.rows;
    height = rows * s.n_y;
    tall = height + s.n_y;
    breadth = rows * s.n_u;
    last = s.markov_last;
    test = memory.take<double>(area(n, s.n_y));
    score = memory.take<double>(area(n, s.n_y));
    solve = memory.take<double>(area(q, s.n_y));
    hankel = memory.take<real>(area(tall, breadth));
    change = memory.take<real>(area(tall, largest));
    for (real** each : {&late, &early_next}) *each = memory.take<real>(area(height, largest));
    for (real** each : {&across, &early, &late_next}) *each = memory.take<real>(area(breadth, largest));
    first = memory.take<real>(area(s.n_y, breadth));
    input = memory.take<real>(area(height, s.n_u));
    for (real** each : {&pencil, &known, &sum, &A}) *each = memory.take<real>(area(largest, largest));
    B = memory.take<real>(area(largest, s.n_u));
    C = memory.take<real>(area(s.n_y, largest));
    D = memory.take<real>(area(s.n_y, s.n_u));
    spread.lay_out(observer, 1, last, memory);
}

/// late, early: what of H(1) V and U^T H(1) is outside U and V; their next terms; E H(0) outside V, H(0) E_u outside U.
okid_status_t linear_era::begin(okid_identify& identifier, const okid_identified_t& full) {
    by = &identifier;
    order = full.n_z;
    ridge = full.observer_info.ridge > 1e-10 ? full.observer_info.ridge : 0; // smaller ones were taken out again
    era = view_of(by->era);
    const int n_u = observer.n_u, n_y = observer.n_y;
    std::fill(test, test + area(n, n_y), 0.0);
    for (int o = 0; o < n_y; ++o) {
        for (int k = 0; k < q; ++k)
            test[area(o, n) + static_cast<size_t>(row_of(observer, k))] = -static_cast<double>(by->theta[k * n_y + o]);
        test[area(o, n) + static_cast<size_t>(n_u + o)] = 1;
    }
    begin_spread(observer, by->theta, by->markov, last, spread);
    fill_hankel(n_u, n_y, rows + 1, rows, by->markov + area(n_u, n_y), hankel);
    const real* H1 = hankel + n_y;
    multiply(false, true, height, order, breadth, 1, H1, tall, era.right, era.rank, 0, late, height);
    multiply(true, false, order, breadth, height, 1, era.left, era.height, H1, tall, 0, early, order);
    multiply(true, false, order, order, height, 1, era.left, era.height, late, height, 0, known, order);
    multiply(false, false, height, order, order, -1, era.left, era.height, known, order, 1, late, height);
    multiply(false, false, order, breadth, order, -1, known, order, era.right, era.rank, 1, early, order);
    multiply(true, false, breadth, order, height, 1, hankel, tall, late, height, 0, late_next, breadth);
    multiply(false, true, height, order, breadth, 1, hankel, tall, early, order, 0, early_next, height);
    for (int j = 0; j < breadth; ++j)
        std::copy(hankel + area(j, tall), hankel + area(j, tall) + n_y, first + area(j, n_y));
    for (int j = 0; j < n_u; ++j)
        std::copy(hankel + area(j, tall), hankel + area(j, tall) + height, input + area(j, height));
    for (int j = 0; j < order; ++j) { // C = E U S, A = S^-1 U^T H(1) V
        if (!(era.values[j] > 0)) return OKID_ERR_NUMERIC;
        for (int o = 0; o < n_y; ++o) C[j * n_y + o] = era.left[area(j, era.height) + size_t(o)] * era.values[j];
        for (int i = 0; i < order; ++i) pencil[j * order + i] = known[j * order + i] / era.values[i];
    }
    multiply(false, false, n_y, breadth, order, -1, C, n_y, era.right, era.rank, 1, first, n_y);
    for (int c = 0; c < n_u; ++c)
        for (int i = 0; i < order; ++i) B[c * order + i] = era.right[c * era.rank + i] * era.values[i];
    multiply(false, false, height, n_u, order, -1, era.left, era.height, B, order, 1, input, height);
    return OKID_OK;
}

/// spread.error <- d theta
void linear_era::change_theta(const double* gram) {
    const int n_y = observer.n_y;
    multiply(false, false, n, n_y, n, 1, gram, n, test, n, 0, score, n);
    for (int o = 0; o < n_y; ++o)
        for (int k = 0; k < q; ++k) {
            const auto row = static_cast<size_t>(row_of(observer, k));
            solve[o * q + k] = score[area(o, n) + row] + ridge * test[area(o, n) + row] * gram[row * area(n + 1, 1)];
        }
    observer_change(observer, by->observer_work, solve);
    for (int k = 0; k < q; ++k)
        for (int o = 0; o < n_y; ++o) spread.error[k * n_y + o] = static_cast<real>(solve[o * q + k]);
}

/// sum <- d(U^T H(1) V) - U^T dH(0) V A; known <- U^T dH(0) V
void linear_era::change_pencil() {
    const real* s = era.values;
    multiply(true, false, order, order, height, 1, era.left, era.height, change, tall, 0, known, order);
    multiply(true, false, order, order, height, 1, era.left, era.height, change + observer.n_y, tall, 0, sum, order);
    multiply(false, false, order, order, order, -1, known, order, pencil, order, 1, sum, order);
    const auto add = [&](auto factor) {
        for (int j = 0; j < order; ++j)
            for (int i = 0; i < order; ++i) sum[j * order + i] += A[j * order + i] * factor(i, j);
    };
    multiply(true, false, order, order, height, 1, change, tall, late, height, 0, A, order);
    add([&](int i, int) { return 1 / s[i]; });
    multiply(false, false, order, order, breadth, 1, across, order, late_next, breadth, 0, A, order);
    add([&](int i, int) { return 1 / (s[i] * s[i]); });
    multiply(false, true, order, order, breadth, 1, early, order, across, order, 0, A, order);
    add([&](int, int j) { return 1 / s[j]; });
    multiply(true, false, order, order, height, 1, early_next, height, change, tall, 0, A, order);
    add([&](int, int j) { return 1 / (s[j] * s[j]); });
}

okid_model_t linear_era::along(const double* gram, double step) {
    const int n_u = observer.n_u, n_y = observer.n_y;
    const real by_step = static_cast<real>(step), *s = era.values;
    change_theta(gram);
    spread_error(observer, last, spread);
    fill_hankel(n_u, n_y, rows + 1, rows, spread.markov + area(n_u, n_y), hankel);
    multiply(false, true, tall, order, breadth, 1, hankel, tall, era.right, era.rank, 0, change, tall);
    multiply(true, false, order, breadth, height, 1, era.left, era.height, hankel, tall, 0, across, order);
    change_pencil();
    multiply(true, false, order, n_u, height, 1, change, tall, input, height, 0, B, order);
    for (int c = 0; c < n_u; ++c)
        for (int i = 0; i < order; ++i) B[c * order + i] = B[c * order + i] / s[i] + across[c * order + i];
    multiply(false, false, order, n_u, order, -1, known, order, era.right, era.rank, 1, B, order);
    for (int c = 0; c < n_u; ++c)
        for (int i = 0; i < order; ++i)
            B[c * order + i] = era.right[c * era.rank + i] + by_step * B[c * order + i] / s[i];
    multiply(false, true, n_y, order, breadth, 1, first, n_y, across, order, 0, C, n_y);
    for (int j = 0; j < order; ++j) {
        for (int o = 0; o < n_y; ++o)
            C[j * n_y + o] = era.left[area(j, era.height) + size_t(o)] * s[j] +
                             by_step * (C[j * n_y + o] / s[j] + change[area(j, tall) + size_t(o)]);
        for (int i = 0; i < order; ++i) A[j * order + i] = pencil[j * order + i] + by_step * sum[j * order + i] / s[i];
    }
    for (int k = 0; k < n_y * n_u; ++k) D[k] = by->markov[k] + by_step * spread.markov[k];
    return {n_u, n_y, order, A, B, C, D, nullptr};
}

} // namespace okid
