// SPDX-License-Identifier: MIT
// PURPOSE    weighting, singular values and leading singular vectors of the projection that a subspace method cuts
// METHOD     eigenvectors of A A^T, then one step A (A^T U) with the matrix itself; an SVD of A where that would cost
//            digits
// REFERENCE  paper eq. (79) and table 1; subspace iteration: Golub, Van Loan, Matrix Computations (2013) 8.2
// NUMERICS   W2 = Pi needs no inverse (trap 6). W1 is the inverse of a Cholesky factor with a floor of 1e-12 of the
//            diagonal: any factor of the covariance does, and without noise the covariance has rank n_z (trap 7). An
//            eigenvector of A A^T is off by eps s_1^2 / (s_i^2 - s_j^2) in the direction of another one; the step with A
//            leaves (s_j / s_i)^2 of that beyond the cut and rounding of eps s_1 / s_i. Taken where the last wanted
//            value is above 3e-5 of the first and all that an order could need above 1e-6, never where the factor came
//            from a QR of the data
// WORKSPACE  (h^2 + (h + w) top) doubles and what the larger of the two decompositions takes; with k columns <= 2 h/3
//            2 h^2 w + 4/3 h^3 + 4 h w k flop, an SVD some 15 h^2 w
#include "identify/subspace.hpp"

#include <cmath>
#include <limits>

using std::size_t;

namespace okid {
namespace {

constexpr double weight_floor = 1e-12, least_square = 1e-9, least_shown = 1e-12; // squares over the first one

} // namespace

int orthonormalise(int rows, int columns, double* x, double* core, int top) {
    constexpr double orthogonal = 1e-2; // then Cholesky of X^T X leaves nothing to repair
    for (int pass = 0; pass < 2; ++pass) {
        linalg::multiply(true, false, columns, columns, rows, 1, x, rows, x, rows, 0, core, top);
        double worst = 0;
        for (int k = 0; k < columns; ++k) { // unit columns
            const double norm = std::sqrt(core[at(k, k, top)]);
            if (!(norm > 0)) return k;
            for (int r = 0; r < rows; ++r) x[at(r, k, rows)] /= norm;
            for (int j = 0; j < columns; ++j) {
                core[at(k, j, top)] /= norm;
                core[at(j, k, top)] /= norm;
            }
        }
        for (int c = 0; c < columns; ++c)
            for (int r = c + 1; r < columns; ++r) worst = std::max(worst, std::abs(core[at(r, c, top)]));
        const int failed = linalg::cholesky(columns, core, top);
        if (failed != 0) return failed - 1;
        for (int c = 0; c < columns; ++c) { // X L^-T
            double* column = x + at(0, c, rows);
            if (c > 0) linalg::multiply(false, true, rows, 1, c, -1, x, rows, core + c, top, 1, column, rows);
            for (int r = 0; r < rows; ++r) column[r] /= core[at(c, c, top)];
        }
        if (worst < orthogonal) break;
    }
    return columns;
}

/// The two decompositions never need their memory at one time.
void rank_cut::share(const subspace_sizes& z, arena& memory) {
    const auto carve = [&](arena squares, arena svd) {
        square_ = squares.take<double>(area(z.h, z.h));
        symmetric_ = squares.take<double>(area(z.h) + linalg::symmetric_work(z.h, z.top));
        target_ = svd.take<okid_real_t>(area(z.h, z.w));
        left_ = svd.take<okid_real_t>(area(z.h, z.h));
        right_ = svd.take<okid_real_t>(area(z.h, z.w));
        svd_ = svd.take<okid_real_t>(linalg::svd_work<okid_real_t>(z.h, z.w));
        return std::max(squares.bytes(), svd.bytes());
    };
    char* block = memory.take<char>(carve(arena(), arena()));
    carve(arena(block), arena(block));
}

void rank_cut::lay_out(const subspace_sizes& z, bool weighted, bool right_side, arena& memory) {
    weight = source = nullptr;
    if (weighted) {
        weight = memory.take<double>(area(z.h, z.h));
        source = memory.take<double>(area(z.h, z.w));
    }
    right_side_ = right_side;
    left = memory.take<double>(area(z.h, z.top));
    right = memory.take<double>(area(z.w, z.top));
    values = memory.take<okid_real_t>(area(z.h));
    solve = memory.take<double>(solve_work(2 * z.w));
    share(z, memory);
}

bool rank_cut::whiten(const subspace_sizes& z) const {
    double* norm = solve; // of the diagonal; free until the solve
    for (int k = 0; k < z.h; ++k) norm[k] = std::sqrt(weight[at(k, k, z.h)]);
    for (int c = 0; c < z.h; ++c) {
        if (!(norm[c] > 0)) return false;
        for (int r = c; r < z.h; ++r) weight[at(r, c, z.h)] /= norm[r] * norm[c];
        weight[at(c, c, z.h)] = 1 + weight_floor;
    }
    if (linalg::cholesky(z.h, weight, z.h) != 0) return false;
    for (int c = 0; c < z.h; ++c) {
        std::fill(weight + at(0, c, z.h), weight + at(c, c, z.h), 0.0);
        for (int r = c; r < z.h; ++r) weight[at(r, c, z.h)] *= norm[r];
    }
    solve_lower(z.h, weight, z.h, source, z.h, z.w, solve);
    return true;
}

/// @return false: too many digits would be lost
bool rank_cut::by_squares(const subspace_sizes& z, const double* from, int ld) {
    double *found = symmetric_, *spare = symmetric_ + z.h;
    lower_product(z.h, [&](int) { return z.w; }, from, ld, 0, square_, z.h);
    if (linalg::symmetric(z.h, square_, z.columns, found, left, spare) != 0) return false;
    if (!(found[z.columns - 1] > least_square * found[0] && found[z.top - 1] > least_shown * found[0])) return false;
    for (int k = 0; k < z.h; ++k) values[k] = static_cast<okid_real_t>(std::sqrt(std::max(0.0, found[k])));
    carried = z.columns;
    linalg::multiply(true, false, z.w, z.columns, z.h, 1, from, ld, left, z.h, 0, right, z.w);
    if (!right_side_) linalg::multiply(false, false, z.h, z.columns, z.w, 1, from, ld, right, z.w, 0, left, z.h);
    return true;
}

bool rank_cut::by_svd(const subspace_sizes& z, const double* from, int ld) {
    for (int c = 0; c < z.w; ++c)
        for (int r = 0; r < z.h; ++r) target_[at(r, c, z.h)] = static_cast<okid_real_t>(from[at(r, c, ld)]);
    if (linalg::svd(z.h, z.w, target_, left_, values, right_, svd_) != 0) return false;
    constexpr okid_real_t rounding = 16 * std::numeric_limits<okid_real_t>::epsilon();
    carried = 0;
    while (carried < z.columns && values[carried] > rounding * values[0]) ++carried;
    for (int k = 0; k < carried; ++k) {
        for (int r = 0; !right_side_ && r < z.h; ++r) left[at(r, k, z.h)] = static_cast<double>(left_[at(r, k, z.h)]);
        for (int c = 0; right_side_ && c < z.w; ++c) right[at(c, k, z.w)] = static_cast<double>(right_[at(k, c, z.h)]);
    }
    return carried > 0;
}

bool rank_cut::decompose(const subspace_sizes& z, const double* from, int ld, bool squares) {
    return (squares && by_squares(z, from, ld)) || by_svd(z, from, ld);
}

} // namespace okid
