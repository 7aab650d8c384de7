// SPDX-License-Identifier: MIT
// PURPOSE    OKID's methods for records without inputs: covariance-driven ERA
// METHOD     R_k = E[y_(n+k) y_n^T] = C A^(k-1) G takes the place of Y_k, G = E[x_(n+1) y_n^T] that of B. States are
//            estimated from the past outputs, x_n = E[x p^T] E[p p^T]^-1 p_n with E[x p^T] = [G, A G, ..]; the Riccati
//            equation of the residuals of these states gives K
// REFERENCE  James, Carne, Lauffer (1995), natural excitation; Van Overschee, De Moor, Subspace Identification (1996)
//            ch. 3; paper eq. (43)-(54)
// NUMERICS   outputs are scaled to unit variance: no unit weighs. R_0 holds the sensors' noise and stands in no Hankel
//            matrix. Residuals are those of least squares: the covariance equations need no positive real sequence
// WORKSPACE  factor of rows + 1 blocks of outputs, (n_y (rows + 1))^2 doubles, n_y (rows + 1) (3 n_z + n_y), and
//            kalman_work(); (n_y rows)^3/3 flop once, 2 (n_y rows)^2 n_z a model with K
#include "identify/identify.hpp"
#include "identify/triangular.hpp"

#include "identify/riccati.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace okid {
namespace {

using linalg::multiply;
constexpr double ridge = 1e-10; // of the unit-diagonal covariance: arrays with more sensors than moving modes

int past_rows(const okid_identify& s) { return s.config.rows * s.n_y; }

/// Covariance of outputs a and b as they stand in the rows y_n, y_(n-1), .. of the Gram matrix, scaled.
double scaled(const okid_identify& s, double rows, int a, int b) {
    const double* scale = s.covariance.scale;
    return s.gram[area(b, s.n) + static_cast<size_t>(a)] / (rows * scale[a % s.n_y] * scale[b % s.n_y]);
}

/// Factor of the covariance of [y_(n-1); ..; y_(n-rows); y_n].
bool factor_past(okid_identify& s, double rows) {
    const int past = past_rows(s), size = past + s.n_y;
    auto place = [&](int k) { return k < past ? k + s.n_y : k - past; };
    double* factor = s.covariance.factor;
    for (int c = 0; c < size; ++c)
        for (int r = c; r < size; ++r)
            factor[area(c, size) + static_cast<size_t>(r)] = scaled(s, rows, place(r), place(c)) + (r == c ? ridge : 0);
    if (linalg::cholesky(size, factor, size) != 0) return false;
    for (int c = 1; c < size; ++c) std::fill(factor + area(c, size), factor + area(c, size) + c, 0.0);
    return true;
}

/// reach <- [G, A G, ..]^T, past x order.
void reach_states(const okid_identify& s, int order) {
    const covariance_work& w = s.covariance;
    const int past = past_rows(s);
    for (int c = 0; c < s.n_y; ++c)
        for (int i = 0; i < order; ++i)
            w.reach[area(i, past) + static_cast<size_t>(c)] = w.G[area(c, order) + static_cast<size_t>(i)];
    for (int k = s.n_y; k < past; k += s.n_y)
        multiply(false, true, s.n_y, order, order, 1, w.reach + k - s.n_y, past, w.A, order, 0, w.reach + k, past);
}

/// Residuals of x_(n+1) = A x_n, y_n = C x_n for the estimated states, as rows over the columns of the factor.
void state_residuals(const okid_identify& s, int order) {
    const covariance_work& w = s.covariance;
    const int past = past_rows(s), size = past + s.n_y, n_y = s.n_y;
    reach_states(s, order);
    linalg::cholesky_solve(past, w.factor, size, w.reach, past, order);
    for (int i = 0; i < order; ++i) { // the filter of x_(n+1): y_n leads, the oldest output drops out
        const double* from = w.reach + area(i, past);
        double* to = w.states + area(i, size);
        std::copy(from + n_y, from + past, to);
        std::fill(to + past - n_y, to + past, 0.0);
        std::copy(from, from + n_y, to + past);
    }
    multiply(true, false, order, size, size, 1, w.states, size, w.factor, size, 0, w.residual, order);
    for (int i = 0; i < order; ++i) { // the filter of x_n
        std::copy(w.reach + area(i, past), w.reach + area(i + 1, past), w.states + area(i, size));
        std::fill(w.states + area(i, size) + past, w.states + area(i + 1, size), 0.0);
    }
    double* now = w.reach; // past x order is all that x_n spans: y_n takes no part in it
    multiply(true, false, order, past, size, 1, w.states, size, w.factor, size, 0, now, order);
    multiply(false, false, order, past, order, -1, w.A, order, now, order, 1, w.residual, order);
    for (int c = 0; c < size; ++c)
        for (int o = 0; o < n_y; ++o)
            w.present[area(c, n_y) + static_cast<size_t>(o)] = w.factor[area(c, size) + static_cast<size_t>(past + o)];
    multiply(false, false, n_y, past, order, -1, w.C, n_y, now, order, 1, w.present, n_y);
}

} // namespace

void lay_out_covariance(okid_identify& s, arena& memory) {
    const int past = past_rows(s), size = past + s.n_y, z = s.max_order;
    covariance_work& w = s.covariance;
    s.sequence = memory.take<okid_real_t>(area(s.markov_last + 1, s.n_y * s.n_y));
    w.scale = memory.take<double>(area(s.n_y));
    w.factor = memory.take<double>(area(size, size));
    w.A = memory.take<double>(area(z, z));
    w.Re = memory.take<double>(area(s.n_y, s.n_y));
    for (double** each : {&w.C, &w.G, &w.K}) *each = memory.take<double>(area(z, s.n_y));
    w.reach = memory.take<double>(area(z, past));
    for (double** each : {&w.states, &w.residual}) *each = memory.take<double>(area(z, size));
    w.present = memory.take<double>(area(s.n_y, size));
    w.kalman = memory.take<double>(kalman_work(z, s.n_y));
}

okid_status_t decompose_covariance(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out) {
    if (out->regression_rows < s.n) return OKID_ERR_TOO_SHORT;
    okid_status_t status = okid_accumulator_gram(accumulator, s.config.detrend, s.gram, s.mean);
    if (status == OKID_OK) status = check_constant_gram(s, s.n, out);
    if (status != OKID_OK) return status;
    const auto rows = static_cast<double>(out->regression_rows);
    for (int o = 0; o < s.n_y; ++o) s.covariance.scale[o] = std::sqrt(s.gram[area(o, s.n + 1)] / rows);
    for (int k = 0; k <= s.markov_last; ++k)
        for (int c = 0; c < s.n_y; ++c)
            for (int o = 0; o < s.n_y; ++o)
                s.sequence[area(k * s.n_y + c, s.n_y) + static_cast<size_t>(o)] =
                    static_cast<okid_real_t>(scaled(s, rows, o, k * s.n_y + c));
    if (out->regression_rows < 10LL * s.q) out->warnings |= OKID_NOTE_FEW_ROWS;
    if (!factor_past(s, rows)) return OKID_ERR_NUMERIC;
    return okid_era_decompose(s.era, s.sequence);
}

okid_status_t realise_covariance(okid_identify& s, int order, bool whole) {
    const covariance_work& w = s.covariance;
    const int n_y = s.n_y, size = past_rows(s) + n_y;
    okid_status_t status = okid_era_realize(s.era, order, s.A, s.B, s.C, nullptr, nullptr);
    if (status != OKID_OK) return status;
    if (whole) {
        std::copy(s.A, s.A + order * order, w.A);
        std::copy(s.B, s.B + order * n_y, w.G);
        std::copy(s.C, s.C + order * n_y, w.C);
        state_residuals(s, order);
        const bool found = kalman_gain({order, n_y, size, w.A, w.C, w.residual, w.present}, w.K, w.Re, w.kalman);
        for (int c = 0; c < n_y; ++c) { // a model without a predictor where there is no gain
            for (int i = 0; i < order; ++i)
                s.K[c * order + i] = static_cast<okid_real_t>(found ? w.K[c * order + i] / w.scale[c] : 0);
            for (int o = 0; o < n_y; ++o)
                s.innovation[c * n_y + o] =
                    static_cast<okid_real_t>(found ? w.Re[c * n_y + o] * w.scale[c] * w.scale[o] : 0);
        }
    }
    for (int k = 0; k < order * n_y; ++k) s.C[k] *= static_cast<okid_real_t>(w.scale[k % n_y]);
    return OKID_OK;
}

} // namespace okid
