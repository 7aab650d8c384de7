// SPDX-License-Identifier: MIT
// PURPOSE    first-order change of a model by a change of the sums it came from, out of the factors of its identification
#pragma once
#include <okid/model.h>

#include "identify/identify.hpp"
#include "identify/subspace.hpp"

namespace okid {

/// What is asked of a change of the sums, G: its products with some columns.
struct asked_of_gram {
    const double* columns; ///< size x count
    int count;
    double* products; ///< to be filled in
};

/// okid-era and okid-era-dc: A, B, C and D, in the states of the right singular vectors; without inputs A and C. What
/// is decomposed is H = N^(1/2) T F, T a Hankel matrix (era_correlation.cpp, tau = 1); of okid-era N and F are 1. G = T
/// F V.
struct linear_era {
    okid_observer_config_t observer;
    okid_era_config_t shape;
    int n, n_y, q, height, tall, breadth, seen,
        last;                        ///< T: height x breadth, tall: a block row more; F: breadth x seen
    double *test, *score, *solve;    ///< [-theta^T; I] by rows of the Gram matrix; its product; q x n_y
    okid_real_t *hankel, *whole;     ///< T, dT, tall; T of okid-era-dc
    okid_real_t *change, *across;    ///< N^(-1/2) dH V, tall; U^T dH
    okid_real_t *held, *base, *room; ///< U^T N^(1/2) T; F V
    okid_real_t *left, *right;       ///< N^(1/2) U, V^T
    okid_real_t *late, *early, *late_next, *early_next, *first, *first_next; ///< what is outside U and V: see outside()
    okid_real_t *rows, *normal, *input, *beside, *lean, *inputs; ///< of the least squares for B: see begin_inputs()
    okid_real_t *pencil, *known, *sum, *A, *B, *C, *D, *out_C;
    okid_real_t* moved; ///< change of the correlations of a record without inputs
    const okid_real_t* values;
    noise_work spread; ///< error of theta -> change of the Markov parameters
    double ridge, samples;
    okid_identify* by;
    int order;

    void lay_out(const okid_identify& shape, int largest, arena& memory);
    okid_status_t begin(okid_identify& by, const okid_identified_t& full);
    asked_of_gram asks() const { return {test, n_y, score}; }
    /// The model plus step times its derivative along the change of the Gram matrix whose products and diagonal are there.
    okid_model_t along(const double* diagonal, double step);

  private:
    bool correlated() const { return shape.tau > 0; }
    int stands(int row) const;
    void through(const okid_real_t* T, const okid_real_t* x, int count, okid_real_t* out) const;
    void back(const okid_real_t* T, const okid_real_t* x, int count, okid_real_t keep, okid_real_t* out) const;
    void begin_test();
    void leave_left(okid_real_t* columns, int count) const;
    void leave_right(okid_real_t* rows_of_F, int count, okid_real_t* scratch) const;
    void outside(const okid_real_t* T);
    bool begin_inputs(const okid_real_t* T);
    void change_theta(const double* diagonal);
    void change_covariances();
    void change_products(const okid_real_t* blocks);
    void change_pencil();
    void change_inputs();
};

/// MOESP and CVA: A and C; B and D are those of the model.
struct linear_subspace {
    int size, n_y, h, functionals;        ///< rows of the Gram matrix, of Y_f; of what is asked of a change of Gamma
    double *dual, *whitened;              ///< W^-1 Gamma, h x n_z; S^-1 Gamma
    double *cross, *root, *back, *normal; ///< n_z x n_z: Gamma^T W^-1 Z W^-1 Gamma; M; M^-1; factor of Gamma_^T Gamma_
    double *ask, *next, *turned;          ///< functionals x h: F, F Z W^-1; h x functionals
    double *left, *right, *rows;          ///< 4 functionals x size, size x 2 n_z; room for either
    double *moved, *found, *solve;
    double *pencil, *A, *C;
    okid_real_t *out_A, *out_C;
    okid_identify* by;
    subspace_view view;
    int order;

    void lay_out(const okid_identify& shape, int largest, arena& memory);
    okid_status_t begin(okid_identify& by, const okid_identified_t& full);
    asked_of_gram asks() const { return {right, 2 * order, moved}; }
    okid_model_t along(double step);

  private:
    bool weigh(bool cva);
    bool ask_for();
    void leave_gamma();
    void to_sums(double* from, int count, double* to, bool transposed);
};

/// SSARX: A, B, C and D as the regression of its states gives them.
struct linear_ssarx {
    int size;                      ///< rows of the Gram matrix
    double *known, *left;          ///< regressors; what the regression leaves, by q, then by the rows of the sums
    double *turn, *across;         ///< S^-1 O applied to the future less M V^T; V^T less it
    double *past, *future, *spare; ///< F and R F of the past, and of the future by T
    double *phi, *omega, *reach;   ///< the same by q; S^-1 T_1 of it; what a change of T meets
    double *dual, *drive;          ///< S^-1 O; future rows of `across`
    double *right, *moved;         ///< columns that a change of the sums is applied to; the products
    double *toeplitz, *arx, *turned, *shifted, *found;
    double *normal, *regression, *change, *solved, *level, *solve;
    okid_real_t *A, *B, *C, *D;
    okid_identify* by;
    subspace_view view;
    int order;

    void lay_out(const okid_identify& shape, int largest, arena& memory);
    okid_status_t begin(okid_identify& by, const okid_identified_t& full);
    asked_of_gram asks() const { return {right, 3 * order + by->n_u + by->n_y, moved}; }
    okid_model_t along(double step);

  private:
    bool regress();
    void ask_for();
    void to_sums(double* rows, int count, double* to, bool transposed);
    void change_of_states();
};

} // namespace okid
