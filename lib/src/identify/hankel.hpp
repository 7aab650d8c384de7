// SPDX-License-Identifier: MIT
// PURPOSE    LQ factor of the block Hankel rows of a record, in the order a method wants, without the Hankel matrix
#pragma once
#include <okid/steps/subspace.h>

#include "linalg/arena.hpp"

namespace okid {

/// How the 2 i m rows stand in the factor.
enum class row_order {
    inputs_first, ///< future inputs (one channel after the other), past by time, future outputs by time
    by_time       ///< samples [u; y], the oldest first
};

struct hankel_factor {
    int n_u, n_y, i, size; ///< size = 2 i m
    double* L;             ///< size x size, lower, zero above the diagonal; L L^T = Gram + ridge
    double *norm, *unit;   ///< of each row, and its inverse
    int* place;            ///< of each row in the matrix it came from
    okid_real_t *triangle, *rows, *panel;
    bool tells_condition; ///< from_gram() does
    double condition;     ///< of the Gram matrix with unit diagonal, by its 1-norm
    double* estimate;     ///< work for it

    void lay_out(arena& memory, bool with_triangle);

    /// From the Gram matrix with at least this ridge. info: ridge, input_excitation, channel.
    okid_status_t from_gram(row_order order, const double* gram, double ridge, okid_subspace_info_t* info);

    /// From the triangular factor in the column order of okid_square_root_factor().
    okid_status_t from_factor(row_order order, const okid_real_t* factor, double ridge, okid_subspace_info_t* info);

  private:
    int channel_of(row_order order, int row) const;
    void place_rows(row_order order, bool outputs_last);
    okid_status_t dead_channel(row_order order, okid_subspace_info_t* info) const;
    okid_status_t excitation(row_order order, okid_subspace_info_t* info) const;
    double fill_unit(const double* gram, double ridge) const;
    void restore_units() const;
};

} // namespace okid
