// SPDX-License-Identifier: MIT
// PURPOSE    ERA of a replicate, whose model is close to a known one, without the SVD of the whole Hankel matrix
// METHOD     two steps of subspace iteration from the known observability matrix give U and V of the leading part;
//            then the pencil in them: A = (U^T H(0) V)^-1 U^T H(1) V, B = (U^T H(0) V)^-1 U^T H(0) E_u, C = E_y^T H(0) V
// REFERENCE  paper eq. (43)-(54); subspace iteration: Golub, Van Loan, Matrix Computations 8.2, 8.6
// NUMERICS   each step brings U closer to the replicate's own by (sigma_(n+1)/sigma_n)^2; what is left of the start
//            perturbs the poles in second order only
// WORKSPACE  a Hankel matrix and 3 h n + 2 n b numbers; 12 h b n flop in the place of some 4 h b^2 + 9 b^3
#include "identify/era_correlation.hpp"
#include "identify/identify.hpp"
#include "identify/triangular.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

namespace okid {
namespace {

using linalg::multiply;
constexpr int steps = 2;

} // namespace

void followed_era::lay_out(const okid_era_config_t& c, int most, arena& memory) {
    height = c.rows * c.n_y;
    breadth = c.cols * c.n_u;
    hankel = memory.take<okid_real_t>(area(height, breadth));
    for (okid_real_t** each : {&start, &left, &seen}) *each = memory.take<okid_real_t>(area(height, most));
    for (okid_real_t** each : {&right, &driven}) *each = memory.take<okid_real_t>(area(most, breadth));
    values = memory.take<okid_real_t>(area(most));
    turn = memory.take<okid_real_t>(area(most, most));
    core = memory.take<okid_real_t>(area(most, std::max(most, c.n_u)));
    work = memory.take<okid_real_t>(std::max(linalg::svd_work(height, most), linalg::svd_work(most, breadth)));
}

bool followed_era::begin(const okid_era_config_t& c, int n_z, const okid_real_t* A, const okid_real_t* C) {
    order = n_z;
    for (int j = 0; j < order; ++j) std::copy(C + area(j, c.n_y), C + area(j + 1, c.n_y), seen + area(j, height));
    for (int k = 1; k < c.rows; ++k) // C A^k below C A^(k-1)
        multiply(false, false, c.n_y, order, order, 1, seen + (k - 1) * c.n_y, height, A, order, 0, seen + k * c.n_y,
                 height);
    return std::all_of(seen, seen + area(height, order), [](okid_real_t x) { return std::isfinite(x); }) &&
           linalg::svd(height, order, seen, start, values, turn, work) == 0;
}

okid_status_t followed_era::realise(const okid_era_config_t& c, const okid_real_t* markov, okid_real_t* A,
                                    okid_real_t* B, okid_real_t* C) {
    const okid_real_t* first = markov + area(c.n_y, c.n_u);
    fill_hankel(c.n_u, c.n_y, c.rows, c.cols, first, hankel);
    std::copy(start, start + area(height, order), left);
    for (int step = 0; step < steps; ++step) {
        multiply(true, false, order, breadth, height, 1, left, height, hankel, height, 0, driven, order);
        if (linalg::svd(order, breadth, driven, turn, values, right, work) != 0) return OKID_ERR_NUMERIC;
        multiply(false, true, height, order, breadth, 1, hankel, height, right, order, 0, seen, height);
        for (int j = 0; j < order; ++j)
            std::copy(seen + area(j, height), seen + area(j, height) + c.n_y, C + area(j, c.n_y));
        if (linalg::svd(height, order, seen, left, values, turn, work) != 0) return OKID_ERR_NUMERIC;
    }
    if (!(values[order - 1] > 0)) return OKID_ERR_NUMERIC;
    for (int j = 0; j < order; ++j) // (U^T H(0) V)^-1 U^T = turn^T left^T from here on
        for (int i = 0; i < height; ++i) left[area(j, height) + static_cast<size_t>(i)] /= values[j];
    multiply(true, false, order, c.n_u, height, 1, left, height, hankel, height, 0, core, order);
    multiply(true, false, order, c.n_u, order, 1, turn, order, core, order, 0, B, order);
    fill_hankel(c.n_u, c.n_y, c.rows, c.cols, first + area(c.n_y, c.n_u), hankel);
    multiply(false, true, height, order, breadth, 1, hankel, height, right, order, 0, seen, height);
    multiply(true, false, order, order, height, 1, left, height, seen, height, 0, core, order);
    multiply(true, false, order, order, order, 1, turn, order, core, order, 0, A, order);
    return OKID_OK;
}

} // namespace okid
