// SPDX-License-Identifier: MIT
// PURPOSE    what the subspace methods share: sizes, the weighted SVD, a model in double; and the two families of
//            methods
#pragma once
#include "identify/hankel.hpp"
#include "identify/triangular.hpp"

namespace okid {

struct subspace_sizes {
    int n_u, n_y, m, i;
    int a, w, h; ///< rows of U_f (i n_u), W_p (i m), Y_f (i n_y)
    int top;     ///< largest order
    int columns; ///< singular vectors that are found, at most top
};

/// A model of one order, before it is rounded to okid_real_t. State k is to be multiplied by scale[k].
struct state_model {
    double *A, *B, *C, *D, *K, *innovation, *scale;
    void lay_out(const subspace_sizes& z, arena& memory);
};

/// Weighting of an h x w matrix A, its singular values and its leading singular vectors of one side.
struct rank_cut {
    double *weight, *source; ///< h x h lower factor of the weight, h x w what is cut
    double *left, *right;    ///< left singular vectors, h x top, or right ones, w x top, as laid out: see decompose()
    okid_real_t* values;
    double* solve;
    int carried; ///< orders that the singular values carry

    void lay_out(const subspace_sizes& z, bool weighted, bool right_side, arena& memory);
    /// weight (lower triangle: a covariance) -> its Cholesky factor; source <- weight^-1 source.
    bool whiten(const subspace_sizes& z) const;
    /// values, carried and vectors of the matrix at `from`. Where it came from a Gram matrix (squares) A A^T may serve;
    /// the vectors then span what they should and are neither unit nor orthogonal: orthonormalise() them.
    bool decompose(const subspace_sizes& z, const double* from, int ld, bool squares);

  private:
    bool right_side_;
    double *square_, *symmetric_;                 ///< A A^T and the work of linalg::symmetric(), in one place with
    okid_real_t *target_, *left_, *right_, *svd_; ///< what linalg::svd() takes
    void share(const subspace_sizes& z, arena& memory);
    bool by_squares(const subspace_sizes& z, const double* from, int ld);
    bool by_svd(const subspace_sizes& z, const double* from, int ld);
};

/// X (rows x columns, ld rows) <- X R^-1 with orthonormal columns, by Cholesky of X^T X, again while that is needed. core:
/// top x top. @return columns that are independent
int orthonormalise(int rows, int columns, double* x, double* core, int top);

/// Decompose for models up to this order only, 0: for all; one of a larger order decomposes again when it is asked for.
/// condition: from_gram() tells it.
void expect(okid_subspace_t* self, int order, bool condition);
/// The factor that was decomposed last by the other projection, for models up to this order. @return OKID_ERR_MISMATCH: there is
/// none, or no memory for the other one: that of CVA serves MOESP too
okid_status_t decompose_as(okid_subspace_t* self, int32_t method, int order);
/// Of the Gram matrix with unit diagonal that was decomposed last.
double condition_of(const okid_subspace_t* self);

/// MOESP and CVA: the column space of the observability matrix.
struct projection {
    /// Of L11, at a time.
    static constexpr int chunk_columns = 32;
    int width;                   ///< a + w + n_y: coordinates of U_f, W_p and y_i
    double *gamma, *core;        ///< orthonormal h x top; Gamma_^T Gamma-bar, top x top
    double *projected, *shifted; ///< Gamma^T L3, Gamma_^T (L3 one block later), top x width
    double *cross, *autos;       ///< L31 L11^T, L11 L11^T
    double *normal, *powers;     ///< of one order n: factor of Gamma_^T Gamma_; C A^k, h x n
    double* theta;               ///< [D; B], p x n_u with p = n_y + n
    double *states, *later;      ///< X_i, X_(i+1), n x width
    double *outputs, *drive;     ///< y_i less what the model says, n_y x width; Gamma^T H, n x a
    double *gain, *solve;        ///< work of kalman_gain() and of the solves
    double *seen, *step;       ///< joint_inputs(): column e of Gamma^T T_k, k = 0.. (p of n x i); its recursion, n x n
    double *across, *lagged;   ///< `seen` transposed, before that C A^b times weights; Horner scheme, two of n x n
    double *equations, *root;  ///< p n_u x p n_u; its diagonal, and scratch
    double *chunk, *remainder; ///< columns of Gamma^T H L11 by unknown; (I - Gamma Gamma^T) cross

    void lay_out(const subspace_sizes& z, arena& memory);
    okid_status_t decompose(const subspace_sizes& z, bool cva, bool squares, const hankel_factor& f, rank_cut& cut);
    okid_status_t realize(const subspace_sizes& z, const hankel_factor& f, int order, bool inputs, bool gain,
                          const state_model& out) const;
    const double* end(const subspace_sizes& z) const { return gamma + z.h - z.n_y; }

  private:
    bool joint_inputs(const subspace_sizes& z, const hankel_factor& f, int order, const state_model& out) const;
    void toeplitz_columns(const subspace_sizes& z, int order, const state_model& out) const;
    void direct_part(const subspace_sizes& z, int order, const state_model& out) const;
    void projected_part(const subspace_sizes& z, const hankel_factor& f, int order) const;
    void right_side(const subspace_sizes& z, int order) const;
    bool residual_gain(const subspace_sizes& z, const hankel_factor& f, int order, const state_model& out) const;
};

/// SSARX: the states themselves.
struct ssarx {
    int width;                            ///< w + m: coordinates of the past and of sample i
    double *theta, *toeplitz, *corrected; ///< ARX model n_y x (w + n_u); correction h x w; future outputs, h x 2 w
    double *basis, *next;                 ///< states in coordinates of the past, w x top; one sample later, top x width
    double *core, *seen, *driven, *end; ///< products of basis with next, y_i, u_i; last observability block, n_y x top
    double *force, *square, *output,
        *later; ///< of one order: u_i less the states; its Gram; residuals of y_i and x_(i+1)
    double *beside, *beside_square, *gain; ///< future inputs and states; Gram of the former; work of kalman_gain()

    void lay_out(const subspace_sizes& z, arena& memory);
    okid_status_t decompose(const subspace_sizes& z, bool squares, const hankel_factor& f, rank_cut& cut) const;
    okid_status_t realize(const subspace_sizes& z, const hankel_factor& f, int order, bool with_gain,
                          const state_model& out) const;

  private:
    void correct(const subspace_sizes& z, const hankel_factor& f, double* solve) const;
    bool last_block(const subspace_sizes& z, const hankel_factor& f, int orders) const;
};

/// out (h x w) <- the part of an ARX model in future samples, to be added to them: block (a, a - lag) = -Ybar_lag.
void fill_correction(const subspace_sizes& z, const double* theta, double* out);

/// What linear_subspace and linear_ssarx read; it stands until the next decomposition. weight: S of CVA and SSARX, h x h lower.
struct subspace_view {
    subspace_sizes sizes;
    const double *L, *weight, *gamma;
    const double *theta, *corrected, *basis, *next; ///< of SSARX
    const int* place;
    int32_t method, carried;
};
subspace_view view_of(const okid_subspace_t* self);

} // namespace okid
