// SPDX-License-Identifier: MIT
// PURPOSE    leading singular triplets of a Hankel matrix of Markov parameters without its SVD
// METHOD     G = H H^T of r + 1 block rows: blocks along a diagonal differ by two products of Markov parameters. Block rows from
//            p on are combinations of those before: G = N^T N with p n_y rows of N = C^-1 [G_11 G_12], C C^T = G_11, and the
//            eigenvectors of N N^T give those of G. H(1) H(0)^T is G a block row lower, so that R^T H(1) S needs no S
// REFERENCE  paper eq. (43)-(54); recursion of Markov parameters: eq. (40)
// NUMERICS   squares: a singular value s_k has the relative error eps (s_1 / s_k)^2. Taken where the last one wanted is above
//            3e-5 of the first, and no pivot of C below 1e-6 of it
// WORKSPACE  G, two matrices of p n_y x r n_y and the eigensolver's; (p n_y)^2 (2 r n_y + 4/3 p n_y) + 2 (r n_y)^2 k flop, an SVD
//            of the matrix some 20 (r n_y)^3
#include "identify/era_leading.hpp"

#include "identify/triangular.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

namespace okid {
namespace {

constexpr double least_square = 1e-9, least_pivot = 1e-12; // over the largest

} // namespace

leading_triplets::leading_triplets(const okid_era_config_t& c, int past, int count_)
    : rows(c.rows), cols(c.cols), n_y(c.n_y), n_u(c.n_u), span(std::min<int>(past, c.rows) * c.n_y),
      count(std::min<int>({count_, span, c.cols * c.n_u})) {}

void leading_triplets::lay_out(arena& memory) {
    const int height = rows * n_y;
    values = memory.take<double>(area(span));
    left = memory.take<double>(area(height, count));
    core = memory.take<double>(area(count, count));
    first = memory.take<double>(area(count, n_u));
    blocks_ = memory.take<double>(area((rows + cols) * n_y, n_u));
    gram_ = memory.take<double>(area(height + n_y, height + n_y));
    head_ = memory.take<double>(area(span, span));
    through_ = memory.take<double>(area(span, height));
    square_ = memory.take<double>(area(span, span));
    vectors_ = memory.take<double>(area(span, count));
    product_ = memory.take<double>(area(height, count));
    work_ = memory.take<double>(std::max(linalg::symmetric_work(span, count), solve_work(height)));
}

/// Both triangles of G, from its last block row upwards: what is added grows.
void leading_triplets::fill_gram(const okid_real_t* markov) {
    const int stack = (rows + cols) * n_y, size = (rows + 1) * n_y; // blocks Y_1 .. Y_(r+c) one below the other
    for (int k = 0; k < rows + cols; ++k)
        for (int c = 0; c < n_u; ++c)
            for (int r = 0; r < n_y; ++r)
                blocks_[at(k * n_y + r, c, stack)] =
                    static_cast<double>(markov[area(k + 1, n_y * n_u) + at(r, c, n_y)]);
    const auto add = [&](double sign, int row, int from, double* to, int many) { // sign Y_row [Y_from ..]^T
        linalg::multiply(false, true, n_y, many * n_y, n_u, sign, blocks_ + row * n_y, stack, blocks_ + from * n_y,
                         stack, 1, to, size);
    };
    double* last = gram_ + rows * n_y;
    for (int c = 0; c < size; ++c) std::fill_n(last + at(0, c, size), n_y, 0.0);
    for (int k = 0; k < cols; ++k) add(1, rows + k, k, last, rows + 1);
    for (int row = rows - 1; row >= 0; --row) {
        double* strip = gram_ + row * n_y;
        for (int c = 0; c < (row + 1) * n_y; ++c)
            std::copy_n(strip + at(n_y, c + n_y, size), n_y, strip + at(0, c, size));
        add(1, row, 0, strip, row + 1);
        add(-1, row + cols, cols, strip, row + 1);
    }
    for (int c = 0; c < rows * n_y; ++c)
        for (int r = 0; r < c; ++r) gram_[at(r, c, size)] = gram_[at(c, r, size)];
}

bool leading_triplets::decompose() {
    const int height = rows * n_y, size = height + n_y;
    for (int c = 0; c < span; ++c) std::copy_n(gram_ + at(0, c, size), span, head_ + at(0, c, span));
    double largest = 0, least = INFINITY;
    for (int c = 0; c < span; ++c) largest = std::max(largest, head_[at(c, c, span)]);
    if (!std::isfinite(largest) || linalg::cholesky(span, head_, span) != 0) return false;
    for (int c = 0; c < span; ++c) {
        least = std::min(least, head_[at(c, c, span)]);
        std::fill(head_ + at(0, c, span), head_ + at(c, c, span), 0.0);
    }
    if (!(least * least > least_pivot * largest)) return false;
    for (int c = 0; c < span; ++c) // N^T of the rows that span: C itself
        for (int r = 0; r < span; ++r) through_[at(r, c, span)] = head_[at(c, r, span)];
    for (int c = span; c < height; ++c) std::copy_n(gram_ + at(0, c, size), span, through_ + at(0, c, span));
    if (height > span) solve_lower(span, head_, span, through_ + at(0, span, span), span, height - span, work_);
    lower_product(span, [height](int) { return height; }, through_, span, 0, square_, span);
    return linalg::symmetric(span, square_, count, values, vectors_, work_) == 0 &&
           values[count - 1] > least_square * values[0];
}

bool leading_triplets::find(const okid_real_t* markov) {
    const int height = rows * n_y, size = height + n_y, stack = (rows + cols) * n_y;
    fill_gram(markov);
    if (!decompose()) return false;
    linalg::multiply(true, false, height, count, span, 1, through_, span, vectors_, span, 0, left, height);
    for (int k = 0; k < count; ++k) {
        values[k] = std::sqrt(values[k]);
        for (int r = 0; r < height; ++r) left[at(r, k, height)] /= values[k];
    }
    linalg::multiply(false, false, height, count, height, 1, gram_ + n_y, size, left, height, 0, product_, height);
    linalg::multiply(true, false, count, count, height, 1, left, height, product_, height, 0, core, count);
    linalg::multiply(true, false, count, n_u, height, 1, left, height, blocks_, stack, 0, first, count);
    for (int k = 0; k < count; ++k) {
        for (int r = 0; r < count; ++r) core[at(r, k, count)] /= values[k];
        for (int c = 0; c < n_u; ++c) first[at(k, c, count)] /= values[k];
    }
    return true;
}

} // namespace okid
