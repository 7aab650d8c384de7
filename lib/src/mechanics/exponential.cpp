// SPDX-License-Identifier: MIT
// PURPOSE    the matrix exponential in fixed memory
// METHOD     scaling to 1-norm <= 1, Taylor polynomial of degree 20 by Horner's rule, squaring; states balanced before
// REFERENCE  Moler, Van Loan (2003), methods 1 and 3; balancing: Parlett, Reinsch (1969), 1-norms, powers of two (exact)
// NUMERICS   truncation 1/21! = 2e-20; no linear solve, hence no conditioning; s squarings cost about 2^s eps at worst,
//            2^s the balanced norm: below 10 for a structure sampled above Nyquist
// WORKSPACE  3 n^2 numbers of the caller; 19 + s products of n x n
#include "exponential.hpp"

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

using std::size_t;
using real = okid_real_t;

namespace okid {
namespace {

constexpr int degree = 20, sweeps = 50;
constexpr real gain_worth_it = real(0.95);

real norm1(int n, const real* a) {
    real largest = 0;
    for (int j = 0; j < n; ++j) {
        const real* column = a + static_cast<size_t>(j) * static_cast<size_t>(n);
        real sum = 0;
        for (int i = 0; i < n; ++i) sum += std::abs(column[i]);
        if (!(sum <= largest)) largest = sum; // a NaN is kept
    }
    return largest;
}

void product(int n, const real* a, const real* b, real* c) {
    linalg::multiply(false, false, n, n, n, 1, a, n, b, n, 0, c, n);
}

} // namespace

void balance(int n, real* a, real* d) {
    const auto ld = static_cast<size_t>(n);
    std::fill(d, d + n, real(1));
    bool moved = true;
    for (int sweep = 0; moved && sweep < sweeps; ++sweep) {
        moved = false;
        for (size_t i = 0; i < ld; ++i) {
            real column = 0, row = 0;
            for (size_t j = 0; j < ld; ++j) {
                if (j == i) continue;
                column += std::abs(a[i * ld + j]);
                row += std::abs(a[j * ld + i]);
            }
            if (!(column > 0 && row > 0 && std::isfinite(column) && std::isfinite(row))) continue;
            const real f = std::exp2(std::round(std::log2(row / column) / 2));
            if (!(column * f + row / f < gain_worth_it * (column + row))) continue;
            moved = true;
            d[i] *= f;
            for (size_t j = 0; j < ld; ++j) {
                a[i * ld + j] *= f;
                a[j * ld + i] /= f;
            }
        }
    }
}

bool exponential(int n, real* x, real* result, real* spare) {
    const auto size = static_cast<size_t>(n) * static_cast<size_t>(n), step = static_cast<size_t>(n) + 1;
    const real norm = norm1(n, x);
    if (!std::isfinite(norm)) return false;
    const int squarings = norm > 1 ? static_cast<int>(std::ceil(std::log2(norm))) : 0;
    const real scale = std::exp2(static_cast<real>(-squarings));
    for (size_t i = 0; i < size; ++i) x[i] *= scale;
    real *now = result, *next = spare;
    for (size_t i = 0; i < size; ++i) now[i] = x[i] / degree;
    for (size_t i = 0; i < size; i += step) now[i] += 1;
    for (int k = degree - 1; k >= 1; --k) { // I + X/k (I + X/(k+1) (..))
        product(n, x, now, next);
        for (size_t i = 0; i < size; ++i) next[i] /= static_cast<real>(k);
        for (size_t i = 0; i < size; i += step) next[i] += 1;
        std::swap(now, next);
    }
    for (int s = 0; s < squarings; ++s) {
        product(n, now, now, next);
        std::swap(now, next);
    }
    if (now != result) std::copy(now, now + size, result);
    return std::isfinite(norm1(n, result));
}

} // namespace okid
