// SPDX-License-Identifier: MIT
// PURPOSE    leading singular triplets of a Hankel matrix of Markov parameters without its SVD
#pragma once
#include <okid/steps/era.h>

#include "linalg/arena.hpp"

namespace okid {

/// What ERA needs of H(0) = R Sigma S^T and H(1), for the `count` largest singular values.
struct leading_triplets {
    int rows, cols, n_y, n_u, span, count;
    double* values = nullptr; ///< descending
    double* left = nullptr;   ///< r n_y x count
    double* core = nullptr;   ///< R^T H(1) S
    double* first = nullptr;  ///< S^T of the first block column, count x n_u

    /// Of a Hankel matrix whose block rows from `past` on are combinations of the `past` rows before each of them, as those of
    /// an ARX model are.
    leading_triplets(const okid_era_config_t& c, int past, int count_);

    void lay_out(arena& memory);

    /// @param markov  as for okid_era_decompose()
    /// @return false: too many digits would be lost, nothing is found
    bool find(const okid_real_t* markov);

  private:
    double *blocks_ = nullptr, *gram_ = nullptr, *head_ = nullptr, *through_ = nullptr, *square_ = nullptr;
    double *vectors_ = nullptr, *product_ = nullptr, *work_ = nullptr;

    void fill_gram(const okid_real_t* markov);
    bool decompose();
};

} // namespace okid
