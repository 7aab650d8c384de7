// SPDX-License-Identifier: MIT
// PURPOSE    the block Hankel matrix of data correlations that ERA/DC decomposes, in a small equivalent form
// METHOD     UU(k) = [RR(k + (a+b) tau)], RR(k) = H(k) H(0)^T, equals E T(k) F: T(k) the Hankel matrix of r + xi tau by
//            c + zeta tau blocks that begins with Y_(k+1), E the rows of T that stand in block row a, F = [H(0)^T,
//            shifted down by b tau blocks]. E^T E = N is diagonal: how often a row of T stands in UU. With the economy
//            decomposition F = G Q^T the matrix N^(1/2) T(k) G has the singular values of UU(k), and vectors that
//            differ from those of UU(k) by the orthonormal E N^(-1/2) and Q only
// REFERENCE  Juang, Cooper, Wright (1988); Juang, Applied System Identification (1994) 5.4; docs/numerics.md
// NUMERICS   exact to rounding: nothing is squared beyond what the correlations themselves square. The normal equations
//            are those of nearly orthonormal columns
// WORKSPACE  T, F, G and the factors of F
#include "identify/era_correlation.hpp"
#include "identify/triangular.hpp"

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

namespace okid {
namespace {

using linalg::multiply;
using std::size_t;

} // namespace

void fill_hankel(int n_u, int n_y, int rows, int cols, const okid_real_t* first, okid_real_t* out) {
    const int height = rows * n_y;
    for (int j = 0; j < cols; ++j)
        for (int c = 0; c < n_u; ++c) {
            okid_real_t* column = out + area(j * n_u + c, height);
            for (int i = 0; i < rows; ++i) {
                const okid_real_t* block = first + area((i + j) * n_u + c, n_y);
                std::copy(block, block + n_y, column + i * n_y);
            }
        }
}

correlation::correlation(const okid_era_config_t& c)
    : config(c), rows(c.rows + c.xi * c.tau), cols(c.cols + c.zeta * c.tau),
      rank(std::min(cols * c.n_u, (c.zeta + 1) * c.rows * c.n_y)) {}

void correlation::lay_out(int columns, arena& memory) {
    const int height = rows * config.n_y, breadth = cols * config.n_u,
              seen = (config.zeta + 1) * config.rows * config.n_y;
    hankel = memory.take<okid_real_t>(area(height, breadth));
    shifts = memory.take<okid_real_t>(area(breadth, seen));
    basis = memory.take<okid_real_t>(area(breadth, rank));
    values = memory.take<okid_real_t>(area(rank));
    right = memory.take<okid_real_t>(area(rank, seen));
    work = memory.take<okid_real_t>(linalg::svd_work(breadth, seen));
    input = memory.take<okid_real_t>(area(height, config.n_u));
    square = memory.take<okid_real_t>(area(columns, columns));
    root = memory.take<okid_real_t>(area(columns, columns));
    repeat = memory.take<okid_real_t>(area(rows));
}

bool correlation::prepare(const okid_real_t* markov) {
    const okid_era_config_t& c = config;
    const int height = rows * c.n_y, breadth = cols * c.n_u, seen = c.rows * c.n_y;
    fill_hankel(c.n_u, c.n_y, rows, cols, markov + area(c.n_u, c.n_y), hankel);
    std::copy(hankel, hankel + area(height, c.n_u), input);
    std::fill(shifts, shifts + area(breadth, (c.zeta + 1) * seen), okid_real_t{0});
    for (int b = 0; b <= c.zeta; ++b)
        for (int y = 0; y < seen; ++y) {
            okid_real_t* column = shifts + area(b * seen + y, breadth) + b * c.tau * c.n_u;
            for (int x = 0; x < c.cols * c.n_u; ++x) column[x] = hankel[area(x, height) + static_cast<size_t>(y)];
        }
    if (linalg::svd(breadth, (c.zeta + 1) * seen, shifts, basis, values, right, work) != 0) return false;
    for (int k = 0; k < rank; ++k)
        for (int x = 0; x < breadth; ++x) basis[area(k, breadth) + static_cast<size_t>(x)] *= values[k];
    for (int i = 0; i < rows; ++i) {
        int stands = 0;
        for (int a = 0; a <= c.xi; ++a) stands += i >= a * c.tau && i < a * c.tau + c.rows;
        repeat[i] = std::sqrt(static_cast<okid_real_t>(stands));
    }
    return true;
}

void correlation::fill(const okid_real_t* markov, int shift, okid_real_t* out) const {
    const int n_u = config.n_u, n_y = config.n_y, height = rows * n_y, breadth = cols * n_u;
    fill_hankel(n_u, n_y, rows, cols, markov + area((1 + shift) * n_u, n_y), hankel);
    for (int x = 0; x < breadth; ++x)
        for (int y = 0; y < height; ++y) hankel[area(x, height) + static_cast<size_t>(y)] *= repeat[y / n_y];
    multiply(false, false, height, rank, breadth, 1, hankel, height, basis, breadth, 0, out, height);
}

void correlation::observability(int columns, okid_real_t* left) const {
    const int height = rows * config.n_y, first = config.rows * config.n_y;
    for (int k = 0; k < columns; ++k)
        for (int y = 0; y < height; ++y) left[area(k, height) + static_cast<size_t>(y)] /= repeat[y / config.n_y];
    multiply(true, false, columns, columns, first, 1, left, height, left, height, 0, square, columns);
}

bool correlation::solve(int order, int columns, okid_real_t* x, int count) const {
    for (int k = 0; k < order; ++k) {
        const okid_real_t* from = square + area(k, columns);
        std::copy(from, from + order, root + area(k, order));
    }
    if (linalg::cholesky(order, root, order) != 0) return false;
    linalg::cholesky_solve(order, root, order, x, columns, count);
    return true;
}

} // namespace okid
