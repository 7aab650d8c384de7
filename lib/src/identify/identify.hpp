// SPDX-License-Identifier: MIT
// PURPOSE    what the parts of okid_identify_run() share: the object, and one function for each step
#pragma once
#include <okid/era.h>
#include <okid/identify.h>
#include <okid/subspace.h>

#include "linalg/arena.hpp"

struct okid_identify {
    okid_identify_config_t config; ///< rows as used
    okid_era_config_t era_config;
    okid_observer_config_t observer_config;
    okid_subspace_config_t subspace_config;
    bool by_subspace;
    int n_u, n_y, m, lags, n, q, max_order, markov_last; ///< n = m (lags + 1); q: unknowns of a regression
    std::size_t observer_bytes, modal_bytes;
    double *gram, *mean;       ///< gram: the Gram matrix, its factor, or S of one run
    double *head, *tail, *sum; ///< of one run
    double* estimate;          ///< of a condition, 4 n
    okid_real_t *theta, *innovation, *markov, *gain;
    okid_real_t* powers; ///< A^k B, twice
    okid_real_t *A, *B, *C, *D, *K, *closed_loop, *eigen_re, *eigen_im, *eigen_work;
    okid_real_t* scores; ///< of the order scan
    okid_real_t *frequency, *damping, *mpc, *emac, *shape_re, *shape_im, *mu_re, *mu_im, *psi_re, *psi_im;
    void *observer_work, *modal_work, *storey_block; ///< storey: ERA or the subspace
    okid_era_t* era;
    okid_subspace_t* subspace;
};

namespace okid {

/// Gram matrix (column c for channel c first), or factor (outputs last): OKID_ERR_INPUT or _OUTPUT names a constant
/// channel.
okid_status_t check_constant_gram(const okid_identify& s, int stride, okid_identified_t* out);
okid_status_t check_constant_factor(const okid_identify& s, okid_identified_t* out);

/// OKID: observer, Markov parameters and the decomposition of their Hankel matrix.
okid_status_t decompose_observer(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out);
okid_status_t decompose_observer(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out);

/// N4SID: the decomposition of the weighted projection.
okid_status_t decompose_subspace(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out);
okid_status_t decompose_subspace(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out);

/// Y_0 .. of the n4sid model.
void model_markov(const okid_identify& s, int order);

/// The order asked for, or the automatic one.
okid_status_t choose_order(okid_identify& s, okid_identified_t* out);

} // namespace okid
