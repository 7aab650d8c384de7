// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of a model by a change of the sums it came from, out of the factors of its identification
#pragma once
#include <okid/model.h>

#include "identify/identify.hpp"
#include "identify/subspace.hpp"

namespace okid {

/// okid-era with inputs: A, B, C and D, in the states of the right singular vectors.
struct linear_era {
    okid_observer_config_t observer;
    int n, q, rows, height, tall, breadth, last; ///< tall: a block row more than height; last: of the Markov parameters
    double *test, *score, *solve;                ///< [-theta^T; I] by rows of the Gram matrix; its product; q x n_y
    okid_real_t *hankel, *change, *across;       ///< dH(0), tall; dH(0) V; U^T dH(0)
    okid_real_t *late, *early, *late_next, *early_next, *first, *input; ///< H(0), H(1) outside U and V: see begin()
    okid_real_t *pencil, *known, *sum, *A, *B, *C, *D;
    noise_work spread; ///< error of theta -> change of the Markov parameters
    double ridge;
    okid_identify* by;
    era_view era;
    int order;

    void lay_out(const okid_identify& shape, int largest, arena& memory);
    okid_status_t begin(okid_identify& by, const okid_identified_t& full);
    /// The model plus step times its derivative along a symmetric change of the Gram matrix.
    okid_model_t along(const double* gram, double step);

  private:
    void change_theta(const double* gram);
    void change_pencil();
};

/// MOESP and CVA: A and C; B and D are those of the model.
struct linear_subspace {
    int size, n_y, h, functionals;        ///< rows of the Gram matrix, of Y_f; of what is asked of a change of Gamma
    double *dual, *whitened;              ///< W^-1 Gamma, h x n_z; S^-1 Gamma
    double *cross, *root, *back, *normal; ///< n_z x n_z: Gamma^T W^-1 Z W^-1 Gamma; M; M^-1; factor of Gamma_^T Gamma_
    double *ask, *next, *turned;          ///< functionals x h: F, F Z W^-1; h x functionals
    double *left, *right, *rows; ///< 4 functionals x size, size x 2 n_z, and before they are in the order of the sums
    double *moved, *seen, *found, *spare, *solve;
    double *pencil, *A, *C;
    okid_real_t *out_A, *out_C;
    okid_identify* by;
    subspace_view view;
    int order;

    void lay_out(const okid_identify& shape, int largest, arena& memory);
    okid_status_t begin(okid_identify& by, const okid_identified_t& full);
    okid_model_t along(const double* gram, double step);

  private:
    bool weigh(bool cva);
    bool ask_for();
    void to_sums(double* from, int count, double* to, bool transposed);
};

} // namespace okid
