// SPDX-License-Identifier: MIT
// PURPOSE    triangular systems and symmetric products in blocks, so that nearly all work is linalg::multiply
#pragma once
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cstddef>

namespace okid {

/// Place of (row, col) in a column-major matrix.
inline std::size_t at(int row, int col, int ld) {
    return static_cast<std::size_t>(col) * static_cast<std::size_t>(ld) + static_cast<std::size_t>(row);
}

/// Numbers in a matrix.
inline std::size_t area(int rows, int cols) { return at(0, cols, rows); }
inline std::size_t area(int count) { return static_cast<std::size_t>(count); }

constexpr int solve_block = 32;

/// Doubles of work for the two solves below with `count` right-hand sides.
inline std::size_t solve_work(int count) {
    return static_cast<std::size_t>(solve_block) * static_cast<std::size_t>(solve_block + count);
}

/// B <- L^-1 B, L n x n lower, B n x count.
void solve_lower(int n, const double* l, int ldl, double* b, int ldb, int count, double* work);

/// B <- B L^-1, L n x n lower, B count x n.
void solve_lower_right(int n, const double* l, int ldl, double* b, int ldb, int count, double* work);

/// Lower triangle of C (n x n) <- A A^T + keep C, where row r of A has extent(r) columns that are not zero (not falling
/// in r). Some entries above the diagonal are written too.
template <class Extent>
void lower_product(int n, Extent extent, const double* a, int lda, double keep, double* c, int ldc) {
    constexpr int strip = 64;
    for (int j = 0; j < n; j += strip) {
        const int wide = std::min(strip, n - j);
        linalg::multiply(false, true, n - j, wide, extent(j + wide - 1), 1, a + j, lda, a + j, lda, keep,
                         c + at(j, j, ldc), ldc);
    }
}

} // namespace okid
