// SPDX-License-Identifier: MIT
// PURPOSE    LQ factor of the block Hankel rows from their Gram matrix or from their triangular factor
// METHOD     rows reordered, unit diagonal, small ridge; Cholesky of the Gram matrix, or Householder reflectors that
//            bring the reordered factor (the root of the ridge under it) back to a triangle
// REFERENCE  docs/numerics.md, central idea; paper eq. (56)-(59)
// NUMERICS   the Gram matrix of (nearly) noise-free records is singular: the ridge, 1e-13 of the unit diagonal, makes
//            it solvable and is raised when rounding asks for it. From the factor nothing is squared and the ridge is
//            one eps: it bounds what the states of noise-free records are read through, below all that data mean
// WORKSPACE  size^2 doubles, from the factor a triangle of size^2/2 numbers more; size^3/3 or 2 size^3 flop
#include "identify/hankel.hpp"

#include "accumulate/householder.h"
#include "identify/triangular.hpp"

#include <cmath>
#include <limits>

namespace okid {
namespace {

using std::size_t;
using real = okid_real_t;
constexpr int batch = 32;
constexpr double first_ridge = 1e-13, last_ridge = 1e-7, excitation_floor = 1e-10;
constexpr int needed_pivots = 5; // of each input: two sines leave four

} // namespace

void hankel_factor::lay_out(arena& memory, bool with_triangle) {
    const auto n = static_cast<size_t>(size);
    L = memory.take<double>(n * n);
    norm = memory.take<double>(n);
    unit = memory.take<double>(n);
    estimate = memory.take<double>(4 * n);
    place = memory.take<int>(n);
    if (!with_triangle) return;
    const size_t stride = okid_triangle_stride(n);
    triangle = memory.take<real>(okid_triangle_size(stride));
    rows = memory.take<real>(batch * stride);
    panel = memory.take<real>((batch + 3) * OKID_PANEL);
}

/// The input channel of a row whose pivot tells of excitation; -1 for all other rows.
int hankel_factor::channel_of(row_order order, int row) const {
    const int m = n_u + n_y;
    if (order == row_order::inputs_first) return row < i * n_u ? row / i : -1;
    return row % m < n_u ? row % m : -1;
}

/// place[row]: lag b = 0 is the newest sample. The columns of a factor have the newest outputs last.
void hankel_factor::place_rows(row_order order, bool outputs_last) {
    const int m = n_u + n_y;
    auto at_time = [&](int t, int channel) {
        const int lag = 2 * i - 1 - t;
        if (!outputs_last) return lag * m + channel;
        if (lag == 0) return channel < n_u ? channel : size - m + channel;
        return n_u + (lag - 1) * m + channel;
    };
    int row = 0;
    if (order == row_order::inputs_first)
        for (int c = 0; c < n_u; ++c)
            for (int k = 0; k < i; ++k) place[row++] = at_time(i + k, c);
    for (int t = 0; t < (order == row_order::by_time ? 2 * i : i); ++t)
        for (int c = 0; c < m; ++c) place[row++] = at_time(t, c);
    if (order == row_order::inputs_first)
        for (int k = 0; k < i; ++k)
            for (int o = n_u; o < m; ++o) place[row++] = at_time(i + k, o);
}

/// unit = 1 / norm; the first channel that has a row of zeros (or of no numbers) is an error.
okid_status_t hankel_factor::dead_channel(row_order order, okid_subspace_info_t* info) const {
    const int m = n_u + n_y, future = size - i * n_y;
    for (int r = 0; r < size; ++r) {
        unit[r] = 1 / norm[r];
        if (norm[r] > 0 && std::isfinite(norm[r])) continue;
        info->channel = channel_of(order, r);
        if (info->channel < 0)
            info->channel = order == row_order::by_time ? r % m
                            : r >= future               ? n_u + (r - future) % n_y
                                                        : (r - i * n_u) % m;
        return info->channel < n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
    }
    return OKID_OK;
}

/// The pivots of the input rows, while L still has rows of unit norm.
okid_status_t hankel_factor::excitation(row_order order, okid_subspace_info_t* info) const {
    double largest = 0, smallest = 1;
    for (int c = 0; c < n_u; ++c) {
        int good = 0, rows_of_channel = 0;
        for (int r = 0; r < size; ++r) {
            if (channel_of(order, r) != c) continue;
            const double pivot = L[at(r, r, size)] * L[at(r, r, size)];
            largest = std::max(largest, pivot);
            smallest = std::min(smallest, pivot);
            good += pivot > excitation_floor;
            ++rows_of_channel;
        }
        if (good >= std::min(needed_pivots, rows_of_channel)) continue;
        info->channel = c;
        info->input_excitation = 0;
        return OKID_ERR_EXCITATION;
    }
    info->input_excitation = largest > 0 ? smallest / largest : 0;
    return OKID_OK;
}

/// Rows get their norms back; zeros above the diagonal.
void hankel_factor::restore_units() const {
    for (int c = 0; c < size; ++c) {
        std::fill(L + at(0, c, size), L + at(c, c, size), 0.0);
        for (int r = c; r < size; ++r) L[at(r, c, size)] *= norm[r];
    }
}

/// Lower triangle of L <- the Gram matrix with unit diagonal and ridge. @return its 1-norm, without the ridge
double hankel_factor::fill_unit(const double* gram, double ridge) const {
    double* sums = estimate;
    std::fill(sums, sums + size, 1.0);
    for (int c = 0; c < size; ++c) {
        double* column = L + at(0, c, size);
        const double* from = gram + at(0, place[c], size);
        column[c] = 1 + ridge;
        for (int r = c + 1; r < size; ++r) column[r] = from[place[r]] * unit[r] * unit[c];
        double below = 0;
        for (int r = c + 1; r < size; ++r) {
            below += std::abs(column[r]);
            sums[r] += std::abs(column[r]);
        }
        sums[c] += below;
    }
    return *std::max_element(sums, sums + size);
}

okid_status_t hankel_factor::from_gram(row_order order, const double* gram, double ridge, okid_subspace_info_t* info) {
    place_rows(order, false);
    for (int r = 0; r < size; ++r) norm[r] = std::sqrt(gram[at(place[r], place[r], size)]);
    const okid_status_t dead = dead_channel(order, info);
    if (dead != OKID_OK) return dead;
    ridge = std::max(ridge, first_ridge);
    for (const double last = std::max(ridge, last_ridge);; ridge *= 100) {
        if (ridge > last) return OKID_ERR_NUMERIC;
        const double size_of_all = fill_unit(gram, ridge);
        if (linalg::cholesky(size, L, size) != 0) continue;
        if (tells_condition) condition = linalg::cholesky_condition(size, L, size, size_of_all, estimate);
        break;
    }
    info->ridge = ridge;
    const okid_status_t status = excitation(order, info);
    restore_units();
    return status;
}

okid_status_t hankel_factor::from_factor(row_order order, const okid_real_t* factor, double ridge,
                                         okid_subspace_info_t* info) {
    place_rows(order, true);
    for (int r = 0; r < size; ++r) {
        const real* column = factor + at(0, place[r], size);
        double sum = 0;
        for (int k = 0; k <= place[r]; ++k) sum += static_cast<double>(column[k]) * static_cast<double>(column[k]);
        norm[r] = std::sqrt(sum);
    }
    const okid_status_t dead = dead_channel(order, info);
    if (dead != OKID_OK) return dead;
    info->ridge = std::max<double>(ridge, std::numeric_limits<real>::epsilon());
    const size_t stride = okid_triangle_stride(static_cast<size_t>(size));
    std::fill(triangle, triangle + okid_triangle_size(stride), real(0));
    for (int r = 0; r < size; ++r)
        triangle[okid_triangle_row(stride, static_cast<size_t>(r)) + static_cast<size_t>(r)] =
            static_cast<real>(std::sqrt(info->ridge));
    okid_householder_fn* append = okid_householder_pick();
    for (int first = 0; first < size; first += batch) {
        const int count = std::min(batch, size - first);
        std::fill(rows, rows + static_cast<size_t>(count) * stride, real(0));
        for (int c = 0; c < size; ++c)
            for (int r = first; r < std::min(first + count, place[c] + 1); ++r)
                rows[static_cast<size_t>(r - first) * stride + static_cast<size_t>(c)] =
                    static_cast<real>(factor[at(r, place[c], size)] * unit[c]);
        append(triangle, stride, rows, count, 0, panel);
    }
    for (int c = 0; c < size; ++c) {
        const real* from = triangle + okid_triangle_row(stride, static_cast<size_t>(c));
        std::copy(from + c, from + size, L + at(c, c, size));
    }
    const okid_status_t status = excitation(order, info);
    restore_units();
    return status;
}

} // namespace okid
