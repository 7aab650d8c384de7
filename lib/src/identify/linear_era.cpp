// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of an okid-era or okid-era-dc model by a change of the sums
// METHOD     d theta = (dG_yv - theta dG_vv) (V V^T)^-1; Markov parameters by the linearised recursion (40), or correlations of
//            the outputs over their variances. Then the pencil in the singular subspaces U, V of H(0) = N^(1/2) T(0) F,
//            A = (U^T H(0) V)^-1 U^T H(1) V, G = T(0) F V, C its first block, B = G_r^+ T(0) E_u, with
//            dU S = (1 - U U^T)(dH V + H dV), dV S = (1 - V V^T)(dH^T U + H^T dU), two terms each; dH = N^(1/2) (dT F + T dF)
// REFERENCE  paper eq. (39), (40), (43)-(54); Doehler, Mevel (2013); docs/numerics.md, uncertainty
// NUMERICS   what the third term of dU, dV would add is of third order in the noise (singular values left out over those taken)
// WORKSPACE  one or two Hankel matrices, 4 (h + b) n_z; a change takes 2 n^2 n_y + 2 q^2 n_y + 4 last p n_y^2 n_u + 4 h b n_z
//            flop (okid-era-dc three times the last)
#include "identify/linear.hpp"

#include <algorithm>
#include <cmath>

namespace okid {

using linalg::multiply;
using std::size_t;
using real = okid_real_t;

namespace {

/// Place of regressor k of theta among the rows of the Gram matrix.
int row_of(const okid_observer_config_t& c, int k) { return k < c.n_u ? k : k + c.n_y; }

} // namespace

void linear_era::lay_out(const okid_identify& s, int largest, arena& memory) {
    observer = s.observer_config;
    shape = s.era_config;
    n = s.n;
    n_y = s.n_y;
    q = s.q;
    height = (shape.rows + shape.xi) * n_y;
    tall = height + n_y;
    breadth = (shape.cols + shape.zeta) * s.width;
    seen = correlated() ? (shape.zeta + 1) * shape.rows * n_y : breadth;
    last = s.markov_last;
    const int n_u = s.n_u, w = s.width;
    hankel = memory.take<real>(area(tall, breadth));
    whole = memory.take<real>(correlated() ? area(tall, breadth) : 0);
    change = memory.take<real>(area(tall, largest));
    room = memory.take<real>(area(std::max(breadth, seen), std::max({largest, n_y, w})));
    for (real** each : {&held, &base}) *each = memory.take<real>(area(breadth, largest));
    for (real** each : {&late, &early_next, &left}) *each = memory.take<real>(area(height, largest));
    for (real** each : {&across, &early, &late_next, &right}) *each = memory.take<real>(area(seen, largest));
    first = memory.take<real>(area(n_y, seen));
    first_next = memory.take<real>(area(height, n_y));
    for (real** each : {&pencil, &known, &sum, &A}) *each = memory.take<real>(area(largest, largest));
    for (real** each : {&C, &out_C}) *each = memory.take<real>(area(n_y, largest));
    test = memory.take<double>(area(n, n_y));
    score = memory.take<double>(area(n, n_y));
    solve = memory.take<double>(area(std::max(q, 1), n_y));
    if (n_u == 0) {
        moved = memory.take<real>(area(last + 1, n_y * w));
        return;
    }
    rows = memory.take<real>(area(shape.rows * n_y, largest));
    normal = memory.take<real>(area(largest, largest));
    lean = memory.take<real>(area(largest, seen));
    input = memory.take<real>(area(shape.rows * n_y, n_u));
    beside = memory.take<real>(area(n_u, seen));
    for (real** each : {&B, &inputs}) *each = memory.take<real>(area(largest, n_u));
    D = memory.take<real>(area(n_y, n_u));
    spread.lay_out(observer, 1, last, memory);
}

/// How often a block row of T stands in what is decomposed: N.
int linear_era::stands(int row) const {
    int count = correlated() ? 0 : 1;
    for (int a = 0; correlated() && a <= shape.xi; ++a) count += row >= a && row < a + shape.rows;
    return count;
}

/// out (breadth x count) <- F x^T, x count x seen; F made of this T.
void linear_era::through(const real* T, const real* x, int count, real* out) const {
    if (!correlated()) {
        for (int c = 0; c < breadth; ++c)
            for (int k = 0; k < count; ++k) out[area(k, breadth) + size_t(c)] = x[c * count + k];
        return;
    }
    std::fill(out, out + area(breadth, count), real{0});
    const int own = shape.rows * n_y, wide = shape.cols * shape.n_u;
    for (int b = 0; b <= shape.zeta; ++b)
        multiply(true, true, wide, count, own, 1, T, tall, x + area(b * own, count), count, 1, out + b * shape.n_u,
                 breadth);
}

/// out (count x seen) <- x F + keep out, x count x breadth.
void linear_era::back(const real* T, const real* x, int count, real keep, real* out) const {
    if (!correlated()) {
        for (size_t k = 0; k < area(count, breadth); ++k) out[k] = x[k] + (keep != 0 ? out[k] : 0);
        return;
    }
    const int own = shape.rows * n_y, wide = shape.cols * shape.n_u;
    for (int b = 0; b <= shape.zeta; ++b)
        multiply(false, true, count, own, wide, 1, x + area(b * shape.n_u, count), count, T, tall, keep,
                 out + area(b * own, count), count);
}

/// Take out of `count` columns of the height, or rows of F, what a first time left of U, or V: of sizes near the largest
/// singular value the rounding alone is as large as the squares of the small ones.
void linear_era::leave_left(real* columns, int count) const {
    for (int k = 0; k < count; ++k) {
        real* column = columns + area(k, height);
        for (int i = 0; i < order; ++i) {
            sum[i] = 0;
            for (int y = 0; y < height; ++y)
                if (const int times = stands(y / n_y); times > 0)
                    sum[i] += left[area(i, height) + size_t(y)] * column[y] / static_cast<real>(times);
        }
        multiply(false, false, height, 1, order, -1, left, height, sum, order, 1, column, height);
    }
}
void linear_era::leave_right(real* rows_of_F, int count, real* scratch) const {
    multiply(false, true, count, order, seen, 1, rows_of_F, count, right, order, 0, scratch, count);
    multiply(false, false, count, seen, order, -1, scratch, count, right, order, 1, rows_of_F, count);
}

/// late, early, first: what of H(1) V, U^T H(1) and C is outside U and V; their next terms. `change` holds T F V, `room`
/// U^T H(1) before F.
void linear_era::outside(const real* T) {
    const auto weigh = [&](real* column) {
        for (int y = 0; y < height; ++y) column[y] *= static_cast<real>(stands(y / n_y));
    };
    back(T, room, order, 0, early);
    multiply(false, false, order, seen, order, -1, known, order, right, order, 1, early, order);
    leave_right(early, order, sum);
    for (int k = 0; k < order; ++k) {
        const real* later = change + area(k, tall) + n_y;
        std::copy(later, later + height, late + area(k, height));
        weigh(late + area(k, height));
    }
    multiply(false, false, height, order, order, -1, left, height, known, order, 1, late, height);
    leave_left(late, order);
    multiply(true, false, order, breadth, height, 1, late, height, T, tall, 0, room, order);
    back(T, room, order, 0, late_next);
    leave_right(late_next, order, sum);
    through(T, early, order, room);
    multiply(false, false, height, order, breadth, 1, T, tall, room, breadth, 0, early_next, height);
    for (int k = 0; k < order; ++k) weigh(early_next + area(k, height));
    leave_left(early_next, order);
    for (int j = 0; j < breadth; ++j) std::copy(T + area(j, tall), T + area(j, tall) + n_y, room + area(j, n_y));
    back(T, room, n_y, 0, first);
    multiply(false, false, n_y, seen, order, -1, C, n_y, right, order, 1, first, n_y);
    leave_right(first, n_y, out_C);
    through(T, first, n_y, room);
    multiply(false, false, height, n_y, breadth, 1, T, tall, room, breadth, 0, first_next, height);
    for (int o = 0; o < n_y; ++o) weigh(first_next + area(o, height));
    leave_left(first_next, n_y);
}

/// rows = G_r, normal = factor of G_r^T G_r, inputs = B, input = T E_u - G_r B; beside = input^T T F, lean = G_r^T (T F - G V^T).
bool linear_era::begin_inputs(const real* T) {
    const int own = shape.rows * n_y, n_u = shape.n_u;
    for (int k = 0; k < order; ++k)
        std::copy(change + area(k, tall), change + area(k, tall) + own, rows + area(k, own));
    for (int j = 0; j < n_u; ++j) std::copy(T + area(j, tall), T + area(j, tall) + own, input + area(j, own));
    multiply(true, false, order, order, own, 1, rows, own, rows, own, 0, normal, order);
    multiply(true, false, order, breadth, own, 1, rows, own, T, tall, 0, room, order);
    back(T, room, order, 0, lean);
    multiply(false, false, order, seen, order, -1, normal, order, right, order, 1, lean, order);
    multiply(true, false, order, n_u, own, 1, rows, own, input, own, 0, inputs, order);
    if (linalg::cholesky(order, normal, order) != 0) return false;
    linalg::cholesky_solve(order, normal, order, inputs, order, n_u);
    multiply(false, false, own, n_u, order, -1, rows, own, inputs, order, 1, input, own);
    multiply(true, false, n_u, breadth, own, 1, input, own, T, tall, 0, room, n_u);
    back(T, room, n_u, 0, beside);
    return true;
}

/// test: what the residuals are made of, without inputs the outputs themselves.
void linear_era::begin_test() {
    const int n_u = by->n_u;
    std::fill(test, test + area(n, n_y), 0.0);
    for (int o = 0; o < n_y; ++o) {
        for (int k = 0; n_u > 0 && k < q; ++k)
            test[area(o, n) + static_cast<size_t>(row_of(observer, k))] = -static_cast<double>(by->theta[k * n_y + o]);
        test[area(o, n) + static_cast<size_t>(n_u + o)] = 1;
    }
    if (n_u > 0) begin_spread(observer, by->theta, by->markov, last, spread);
}

okid_status_t linear_era::begin(okid_identify& identifier, const okid_identified_t& full) {
    by = &identifier;
    order = full.n_z;
    ridge = full.observer_info.ridge > 1e-10 ? full.observer_info.ridge : 0; // smaller ones were taken out again
    samples = static_cast<double>(full.regression_rows);
    const era_view era = view_of(by->era);
    values = era.values;
    if (!(values[order - 1] > 0)) return OKID_ERR_NUMERIC;
    begin_test();
    const int w = shape.n_u;
    fill_hankel(w, n_y, tall / n_y, breadth / w, (by->n_u > 0 ? by->markov : by->sequence) + area(w, n_y), hankel);
    if (correlated()) std::copy(hankel, hankel + area(tall, breadth), whole);
    const real* T = correlated() ? whole : hankel;
    for (int k = 0; k < order; ++k)
        for (int y = 0; y < height; ++y) // of okid-era-dc N^(-1/2) U is there
            left[area(k, height) + size_t(y)] =
                era.left[area(k, era.height) + size_t(y)] * static_cast<real>(stands(y / n_y));
    if (correlated())
        multiply(false, false, order, seen, era.breadth, 1, era.right, era.rank, era.basis, era.breadth, 0, right,
                 order);
    else
        for (int c = 0; c < seen; ++c)
            std::copy(era.right + area(c, era.rank), era.right + area(c, era.rank) + order, right + area(c, order));
    through(T, right, order, base);
    multiply(false, false, tall, order, breadth, 1, T, tall, base, breadth, 0, change, tall);
    multiply(true, false, order, order, height, 1, left, height, change + n_y, tall, 0, known, order);
    if (correlated()) multiply(true, false, order, breadth, height, 1, left, height, T, tall, 0, held, order);
    multiply(true, false, order, breadth, height, 1, left, height, T + n_y, tall, 0, room, order);
    for (int j = 0; j < order; ++j) { // A = S^-1 U^T H(1) V
        std::copy(change + area(j, tall), change + area(j, tall) + n_y, C + area(j, n_y));
        for (int i = 0; i < order; ++i) pencil[j * order + i] = known[j * order + i] / values[i];
    }
    outside(T);
    return by->n_u == 0 || begin_inputs(T) ? OKID_OK : OKID_ERR_NUMERIC;
}

/// spread.error <- d theta
void linear_era::change_theta(const double* diagonal) {
    for (int o = 0; o < n_y; ++o)
        for (int k = 0; k < q; ++k) {
            const auto row = static_cast<size_t>(row_of(observer, k));
            solve[o * q + k] = score[area(o, n) + row] + ridge * test[area(o, n) + row] * diagonal[row];
        }
    observer_change(observer, by->observer_work, solve);
    for (int k = 0; k < q; ++k)
        for (int o = 0; o < n_y; ++o) spread.error[k * n_y + o] = static_cast<real>(solve[o * q + k]);
}

/// moved <- change of the correlations; solve <- relative change of the deviations they are scaled by.
void linear_era::change_covariances() {
    const double* scale = by->covariance.scale;
    const auto over = [&](int o, int c, int k) {
        return score[area(o, n) + size_t(k * n_y + c)] / (samples * scale[o] * scale[c]);
    };
    for (int o = 0; o < n_y; ++o) solve[o] = over(o, o, 0) / 2;
    for (int k = 0; k <= last; ++k)
        for (int c = 0; c < n_y; ++c)
            for (int o = 0; o < n_y; ++o) {
                const int at = (k * n_y + c) * n_y + o;
                moved[at] =
                    static_cast<real>(over(o, c, k) - (solve[o] + solve[c]) * static_cast<double>(by->sequence[at]));
            }
}

/// sum <- d(U^T H(1) V) - U^T dH(0) V A; known <- U^T dH(0) V
void linear_era::change_pencil() {
    const real* s = values;
    multiply(true, false, order, order, height, 1, left, height, change, tall, 0, known, order);
    multiply(true, false, order, order, height, 1, left, height, change + n_y, tall, 0, sum, order);
    multiply(false, false, order, order, order, -1, known, order, pencil, order, 1, sum, order);
    const auto add = [&](auto factor) {
        for (int j = 0; j < order; ++j)
            for (int i = 0; i < order; ++i) sum[j * order + i] += A[j * order + i] * factor(i, j);
    };
    multiply(true, false, order, order, height, 1, change, tall, late, height, 0, A, order);
    add([&](int i, int) { return 1 / s[i]; });
    multiply(false, true, order, order, seen, 1, across, order, late_next, order, 0, A, order);
    add([&](int i, int) { return 1 / (s[i] * s[i]); });
    multiply(false, true, order, order, seen, 1, early, order, across, order, 0, A, order);
    add([&](int, int j) { return 1 / s[j]; });
    multiply(true, false, order, order, height, 1, early_next, height, change, tall, 0, A, order);
    add([&](int, int j) { return 1 / (s[j] * s[j]); });
}

/// B <- (G_r^T G_r)^-1 (dG_r^T (T E_u - G_r B) + G_r^T (dT E_u - dG_r B)), dG = change + (T F - G V^T) across^T S^-1
void linear_era::change_inputs() {
    const int own = shape.rows * n_y, n_u = shape.n_u;
    const real* s = values;
    real* turned = room; // seen x n_u: across^T S^-1 B
    for (int c = 0; c < n_u; ++c)
        for (int i = 0; i < order; ++i) B[c * order + i] = inputs[c * order + i] / s[i];
    multiply(true, false, seen, n_u, order, 1, across, order, B, order, 0, turned, seen);
    multiply(false, true, order, n_u, seen, 1, across, order, beside, n_u, 0, B, order);
    for (int c = 0; c < n_u; ++c)
        for (int i = 0; i < order; ++i) B[c * order + i] /= s[i];
    multiply(false, false, order, n_u, seen, -1, lean, order, turned, seen, 1, B, order);
    multiply(true, false, order, n_u, own, 1, change, tall, input, own, 1, B, order);
    multiply(true, false, order, n_u, own, 1, rows, own, hankel, tall, 1, B, order);
    multiply(true, false, order, order, own, 1, rows, own, change, tall, 0, known, order);
    multiply(false, false, order, n_u, order, -1, known, order, inputs, order, 1, B, order);
    linalg::cholesky_solve(order, normal, order, B, order, n_u);
}

/// change, across <- dH(0) V and U^T dH(0), out of the change of the blocks.
void linear_era::change_products(const real* blocks) {
    const int w = shape.n_u;
    fill_hankel(w, n_y, tall / n_y, breadth / w, blocks + area(w, n_y), hankel);
    multiply(false, false, tall, order, breadth, 1, hankel, tall, base, breadth, 0, change, tall);
    multiply(true, false, order, breadth, height, 1, left, height, hankel, tall, 0, room, order);
    back(whole, room, order, 0, across);
    if (!correlated()) return;
    back(hankel, held, order, 1, across);
    through(hankel, right, order, room);
    multiply(false, false, tall, order, breadth, 1, whole, tall, room, breadth, 1, change, tall);
}

okid_model_t linear_era::along(const double* diagonal, double step) {
    const int n_u = by->n_u;
    const real by_step = static_cast<real>(step);
    if (n_u > 0) {
        change_theta(diagonal);
        spread_error(observer, last, spread);
    } else {
        change_covariances();
    }
    change_products(n_u > 0 ? spread.markov : moved);
    change_pencil();
    if (n_u > 0) change_inputs();
    for (int k = 0; k < order * n_u; ++k) B[k] = inputs[k] + by_step * B[k];
    for (int k = 0; k < n_y * n_u; ++k) D[k] = by->markov[k] + by_step * spread.markov[k];
    multiply(true, false, n_y, order, height, 1, first_next, height, change, tall, 0, out_C, n_y);
    for (int k = 0; k < order * n_y; ++k) out_C[k] /= values[k / n_y];
    multiply(false, true, n_y, order, seen, 1, first, n_y, across, order, 1, out_C, n_y);
    for (int j = 0; j < order; ++j) {
        for (int o = 0; o < n_y; ++o)
            out_C[j * n_y + o] =
                C[j * n_y + o] + by_step * (out_C[j * n_y + o] / values[j] + change[area(j, tall) + size_t(o)]);
        for (int i = 0; i < order; ++i)
            A[j * order + i] = pencil[j * order + i] + by_step * sum[j * order + i] / values[i];
    }
    for (int k = 0; n_u == 0 && k < order * n_y; ++k)
        out_C[k] *= static_cast<real>(by->covariance.scale[k % n_y] * std::exp(step * solve[k % n_y]));
    return {n_u, n_y, order, A, B, out_C, D, nullptr};
}

} // namespace okid
