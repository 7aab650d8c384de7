// SPDX-License-Identifier: MIT
// PURPOSE    the block Hankel matrix of data correlations that ERA/DC decomposes, in a small equivalent form
#pragma once
#include <okid/steps/era.h>

#include "linalg/arena.hpp"

namespace okid {

/// block (i, j) = first[i + j]; rows x cols blocks of n_y x n_u, column-major.
void fill_hankel(int n_u, int n_y, int rows, int cols, const okid_real_t* first, okid_real_t* out);

/// The decomposition that an ERA holds: U (height x rank), singular values, V^T (rank x breadth). With correlations
/// N^(-1/2) U and the factor Q^T of F (breadth rows), else nullptr.
struct era_view {
    int height, breadth, rank;
    const okid_real_t *left, *values, *right, *basis;
};
era_view view_of(const okid_era_t* self);

struct correlation {
    okid_era_config_t config;
    int rows, cols, rank;                       ///< block rows and columns of the tall Hankel matrix; columns of basis
    okid_real_t *hankel{}, *shifts{}, *basis{}; ///< tall Hankel matrix; F and its left factor, cols n_u x rank
    okid_real_t *values{}, *right{}, *work{};   ///< of the decomposition of F
    okid_real_t *input{}, *repeat{};            ///< first columns of H(0); weight of a block row
    okid_real_t *square{}, *root{};             ///< normal equations

    correlation() : correlation(okid_era_config_t{}) {}
    explicit correlation(const okid_era_config_t& c);
    void lay_out(int columns, arena& memory);

    /// basis, from the Markov parameters.
    bool prepare(const okid_real_t* markov);

    /// out, rows n_y x rank: shares singular values with UU(shift), its left vectors are made by observability().
    void fill(const okid_real_t* markov, int shift, okid_real_t* out) const;

    /// left vectors of out -> rows of the observability matrix, and their normal equations over the first r blocks.
    void observability(int columns, okid_real_t* left) const;

    /// x <- least-squares solution over the first r block rows; x holds the products with the rows, order x count.
    bool solve(int order, int columns, okid_real_t* x, int count) const;
};

} // namespace okid
