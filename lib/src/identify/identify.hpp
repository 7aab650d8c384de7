// SPDX-License-Identifier: MIT
// PURPOSE    what the parts of okid_identify_run() share: the object, and one function for each step
#pragma once
#include <okid/identify.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>

#include "identify/era_correlation.hpp"
#include "identify/noise_level.hpp"
#include "linalg/arena.hpp"

namespace okid {

/// Of an okid method without inputs; outputs scaled to unit variance.
struct covariance_work {
    double *scale, *factor;            ///< n_y standard deviations; factor of [past; present] of the outputs
    double *A, *C, *G, *K, *Re;        ///< of the model in hand; G = E[x_(n+1) y_n^T]
    double *reach, *states, *residual; ///< covariance of state and past, transposed; state filter; residuals of x
    double *present, *kalman;          ///< residuals of y; work of kalman_gain()
};

} // namespace okid

struct okid_identify;
namespace okid {

/// ERA that starts from a known model: two steps of subspace iteration from its observability matrix in the place of an SVD.
struct followed_era {
    int height, breadth, order;
    okid_real_t *hankel, *start, *left, *right; ///< h x b, h x n, h x n, n x b
    okid_real_t *seen, *driven, *values, *turn, *core, *work;

    /// @param most  largest order
    void lay_out(const okid_era_config_t& c, int most, arena& memory);
    /// From A and C of a model. @return false: their powers run out of range
    bool begin(const okid_era_config_t& c, int n_z, const okid_real_t* A, const okid_real_t* C);
    /// A, B and C from Markov parameters.
    okid_status_t realise(const okid_era_config_t& c, const okid_real_t* markov, okid_real_t* A, okid_real_t* B,
                          okid_real_t* C);
};

} // namespace okid

struct okid_identify {
    okid_identify_config_t config; ///< rows as used
    okid_era_config_t era_config;
    okid_observer_config_t observer_config;
    okid_subspace_config_t subspace_config;
    bool by_subspace, by_covariance;                     ///< neither: by the observer
    bool from_sums;                                      ///< what was decomposed last: not from a triangular factor
    int n_u, n_y, m, lags, n, q, max_order, markov_last; ///< n = m (lags + 1); q: unknowns of a regression
    std::size_t observer_bytes, modal_bytes;
    double *gram, *mean;       ///< gram: the Gram matrix, its factor, or S of one run
    double *head, *tail, *sum; ///< of one run
    okid_real_t *theta, *innovation, *markov, *gain;
    int follow;                   ///< order of replicate(), 0: a full identification
    bool modes_only;              ///< replicate(): A and C are enough
    bool poles_only;              ///< the caller needs only poles of orders up to max_order
    okid::followed_era* followed; ///< ERA of replicate() near a known model, or nullptr
    int width;                    ///< columns of a block of the Hankel matrix
    okid_real_t* sequence;        ///< blocks 0 .. markov_last of the Hankel matrix, n_y x width; block 0 is not used
    okid_real_t *input_root, *innovation_root; ///< factors of Su and Se
    okid_real_t* powers;                       ///< A^k B, twice
    okid_real_t *A, *B, *C, *D, *K, *closed_loop, *eigen_re, *eigen_im, *eigen_work;
    okid_real_t* scores; ///< of the order scan
    okid_real_t *frequency, *damping, *mpc, *emac, *cmi, *shape_re, *shape_im, *mu_re, *mu_im, *psi_re, *psi_im;
    void *observer_work, *modal_work, *storey_block; ///< storey: ERA or the subspace
    okid::covariance_work covariance;
    okid::noise_work noise;
    okid_era_t* era;
    okid_subspace_t* subspace;
};

namespace okid {

/// The object without memory: its sizes and configurations.
okid_identify plan_of(const okid_identify_config_t& config);

/// Gram matrix (column c for channel c first), or factor (outputs last): OKID_ERR_INPUT or _OUTPUT names a constant
/// channel.
okid_status_t check_constant_gram(const okid_identify& s, int stride, okid_identified_t* out);
okid_status_t check_constant_factor(const okid_identify& s, okid_identified_t* out);

/// OKID: observer, Markov parameters and the decomposition of their Hankel matrix.
okid_status_t decompose_observer_gram(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out);
okid_status_t decompose_observer_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out);

/// Factors of Su and Se, the weights of OKID_HANKEL_INNOVATIONS, from what s.gram holds: a matrix with column c for
/// channel c first, or a triangular factor.
void weigh_by_gram(okid_identify& s, int stride, int64_t rows);
void weigh_by_factor(okid_identify& s, int64_t rows);

/// Is the noise level of the singular values found? Only where an order is to be chosen.
bool knows_noise(const okid_identify_config_t& config);

/// Blocks of the Hankel matrix out of the Markov parameters, as config.hankel says.
const okid_real_t* hankel_blocks(okid_identify& s);

/// okid_era_decompose() for the `count` largest singular values, of Markov parameters of an ARX model of `past` lags; all of
/// them where the leading ones alone would lose digits.
okid_status_t decompose_leading(okid_era_t* self, const okid_real_t* markov, int count, int past);

/// A, B, C, K of one order by ERA; `whole` false: A and C are enough.
okid_status_t realise_era(okid_identify& s, int order, bool whole);

/// OKID without inputs: covariances of the outputs and the decomposition of their Hankel matrix; models of one order.
void lay_out_covariance(okid_identify& s, arena& memory);
okid_status_t decompose_covariance(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out);
okid_status_t realise_covariance(okid_identify& s, int order, bool whole);

/// N4SID: the decomposition of the weighted projection.
okid_status_t decompose_subspace_gram(okid_identify& s, okid_accumulator_t* accumulator, okid_identified_t* out);
okid_status_t decompose_subspace_factor(okid_identify& s, okid_square_root_t* square_root, okid_identified_t* out);

/// Y_0 .. of the n4sid model.
void model_markov(const okid_identify& s, int order);

/// A model of one order from sums, nothing but A, B, C and D, which is all that is needed where s.follow is set.
okid_status_t replicate(okid_identify& s, okid_accumulator_t* accumulator, int order, okid_identified_t* out);
okid_status_t realise_model(okid_identify& s, int order);

/// The order asked for, or the automatic one.
okid_status_t choose_order(okid_identify& s, okid_identified_t* out);

} // namespace okid
