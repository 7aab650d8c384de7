// SPDX-License-Identifier: MIT
// PURPOSE    Gram matrix and triangular factor in engineering units from a square-root accumulator
// METHOD     value = scale (sample + reference) + offset changes the first row of the factor only; the mean is removed by
//            leaving that row out, or put in by Givens rotations; R^T R by panels of rows
// REFERENCE  docs/numerics.md, central idea: offsets
// NUMERICS   a few eps of okid_real_t; products and units in double
// WORKSPACE  9 n doubles in the block; 2/3 N^3 flop for the Gram matrix, O(N^2) for the factor
#include "accumulate/square_root.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>

using real = okid_real_t;
using std::size_t;

namespace {

/// What results are made of: the factor of all rows and the unit of each of its columns, the column of ones left out.
struct source {
    okid_square_root& a;
    const real* whole;
    double* unit;
    size_t n;

    explicit source(okid_square_root& self)
        : a(self), whole(okid::square_root_whole(self)), unit(self.wide() + OKID_PANEL * static_cast<size_t>(self.n)),
          n(static_cast<size_t>(self.n)) {
        for (int32_t k = 0; k < a.n; ++k) unit[k] = a.scale()[a.channel(k)];
    }

    /// Row i of the factor, i >= 1, from column `from` on, which must stand in its panel or right of it.
    void row(size_t i, size_t from, double* out) const {
        const real* r = whole + okid_triangle_row(a.stride, i) + 1;
        for (size_t k = from; k < n; ++k) out[k] = unit[k] * r[k];
    }

    /// Row 0: the sum of each column over the root of the weight of all rows.
    void mean_row(double* out) const {
        for (int32_t k = 0; k < a.n; ++k) {
            const int32_t c = a.channel(k);
            const double middle = unit[k] * a.reference()[c] + a.scale()[a.m + c];
            out[k] = unit[k] * whole[k + 1] + middle * whole[0];
        }
    }

    void means(double* out) const {
        for (int32_t c = 0; out != nullptr && c < a.m; ++c) {
            const int32_t k = c < a.config.n_u ? c : a.q + c - a.config.n_u;
            out[c] = unit[k] * (whole[k + 1] / static_cast<double>(whole[0]) + a.reference()[c]) + a.scale()[a.m + c];
        }
    }
};

/// Rotate one more row (destroyed) into the upper triangle.
void rotate_in(real* factor, size_t n, double* row) {
    for (size_t k = 0; k < n; ++k) {
        if (row[k] == 0) continue;
        const double diagonal = factor[k * n + k], length = std::hypot(diagonal, row[k]);
        const double cosine = diagonal / length, sine = row[k] / length;
        for (size_t j = k; j < n; ++j) {
            const double x = factor[j * n + k], y = row[j];
            factor[j * n + k] = static_cast<real>(cosine * x + sine * y);
            row[j] = cosine * y - sine * x;
        }
    }
}

} // namespace

okid_status_t okid_square_root_gram(okid_square_root_t* self, okid_detrend_t detrend, double* gram, double* mean) {
    if (self == nullptr || gram == nullptr) return OKID_ERR_NULL;
    if (self->stats.rows == 0) return OKID_ERR_TOO_SHORT;
    const source s(*self);
    const size_t n = s.n, n_u = static_cast<size_t>(self->config.n_u), q = static_cast<size_t>(self->q);
    double* panel = self->wide(); // OKID_PANEL rows of n
    std::fill(gram, gram + n * n, 0.0);
    for (size_t first = 0; first <= n; first += OKID_PANEL) {
        const size_t count = std::min<size_t>(OKID_PANEL, n + 1 - first), from = first > 0 ? first - 1 : 0;
        for (size_t i = 0; i < count; ++i)
            if (first + i > 0)
                s.row(first + i, from, panel + i * n);
            else if (detrend == OKID_DETREND_NONE)
                s.mean_row(panel);
            else
                std::fill(panel, panel + n, 0.0);
        const int size = static_cast<int>(n - from), ld = static_cast<int>(n);
        okid::linalg::multiply(false, true, size, size, static_cast<int>(count), 1.0, panel + from, ld, panel + from,
                               ld, 1.0, gram + from * n + from, ld);
    }
    std::rotate(gram + n_u * n, gram + q * n, gram + n * n); // y_n from the end to behind u_n
    for (size_t j = 0; j < n; ++j) std::rotate(gram + j * n + n_u, gram + j * n + q, gram + (j + 1) * n);
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < j; ++i) gram[i * n + j] = gram[j * n + i];
    s.means(mean);
    return OKID_OK;
}

okid_status_t okid_square_root_factor(okid_square_root_t* self, okid_detrend_t detrend, okid_real_t* factor,
                                      double* mean) {
    if (self == nullptr || factor == nullptr) return OKID_ERR_NULL;
    if (self->stats.rows == 0) return OKID_ERR_TOO_SHORT;
    const source s(*self);
    const size_t n = s.n;
    double* row = self->wide();
    std::fill(factor, factor + n * n, real(0));
    for (size_t i = 0; i < n; ++i) {
        s.row(i + 1, i, row);
        const double sign = row[i] < 0 ? -1 : 1;
        for (size_t j = i; j < n; ++j) factor[j * n + i] = static_cast<real>(sign * row[j]);
    }
    if (detrend == OKID_DETREND_NONE) {
        s.mean_row(row);
        rotate_in(factor, n, row);
    }
    s.means(mean);
    return OKID_OK;
}
