// SPDX-License-Identifier: MIT
// PURPOSE    triangular systems in blocks of 32 columns
// METHOD     the diagonal block is inverted, everything else is a product
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 3.1; Higham, Accuracy and Stability (2002) 8.4, 14.2
// NUMERICS   as forward substitution, with the condition of the diagonal blocks in the place of 1
// WORKSPACE  solve_work(count) doubles; n^2 count flop
#include "identify/triangular.hpp"

namespace okid {
namespace {

/// X (n x n, ld solve_block) <- L^-1, n <= solve_block.
void invert(int n, const double* l, int ldl, double* x) {
    for (int j = 0; j < n; ++j) {
        double* column = x + at(0, j, solve_block);
        std::fill(column, column + n, 0.0);
        column[j] = 1;
        for (int k = j; k < n; ++k) {
            column[k] /= l[at(k, k, ldl)];
            for (int i = k + 1; i < n; ++i) column[i] -= l[at(i, k, ldl)] * column[k];
        }
    }
}

} // namespace

void solve_lower(int n, const double* l, int ldl, double* b, int ldb, int count, double* work) {
    double* spare = work + at(0, solve_block, solve_block);
    for (int k = 0; k < n; k += solve_block) {
        const int size = std::min(solve_block, n - k);
        invert(size, l + at(k, k, ldl), ldl, work);
        linalg::multiply(false, false, size, count, size, 1, work, solve_block, b + k, ldb, 0, spare, solve_block);
        for (int c = 0; c < count; ++c)
            std::copy(spare + at(0, c, solve_block), spare + at(size, c, solve_block), b + at(k, c, ldb));
        if (k + size < n)
            linalg::multiply(false, false, n - k - size, count, size, -1, l + at(k + size, k, ldl), ldl, spare,
                             solve_block, 1, b + k + size, ldb);
    }
}

void solve_lower_right(int n, const double* l, int ldl, double* b, int ldb, int count, double* work) {
    double* spare = work + at(0, solve_block, solve_block);
    for (int k = (n - 1) / solve_block * solve_block; k >= 0; k -= solve_block) {
        const int size = std::min(solve_block, n - k);
        invert(size, l + at(k, k, ldl), ldl, work);
        double* panel = b + at(0, k, ldb);
        linalg::multiply(false, false, count, size, size, 1, panel, ldb, work, solve_block, 0, spare, count);
        for (int c = 0; c < size; ++c)
            std::copy(spare + at(0, c, count), spare + at(count, c, count), panel + at(0, c, ldb));
        if (k > 0) linalg::multiply(false, false, count, k, size, -1, panel, ldb, l + k, ldl, 1, b, ldb);
    }
}

} // namespace okid
