// SPDX-License-Identifier: MIT
// PURPOSE    filters in the modal coordinates of a given A, and the Gram matrix of their signals over a run of samples
#pragma once
#include "identify/triangular.hpp"
#include "linalg/arena.hpp"

namespace okid {

/// Signals: [u; phi_c = sum of w^(t-1-s) u_c(s), for each input c; w^t], a pair of eigenvalues as real and imaginary
/// part. With c = C V the regressors of a pair on one output are the parts of (c1 + i c2)(f + i g), times [b1; b2]: one
/// Gram matrix of the signals serves all outputs.
struct modal_filters {
    int n_u, n_y, n_z;
    int base, free; ///< signals; where w^t begins
    double* modes;  ///< V, n_z x n_z: x = V z, the columns of a pair are real and imaginary part
    double* sums;   ///< base x base: signals signals^T, lower triangle until complete_sums()
    double* with_y; ///< base x n_y: signals outputs^T
    long long used; ///< samples in the sums since start()

    modal_filters(int inputs, int outputs, int states, arena& memory);
    bool decompose(const okid_real_t* A, const okid_real_t* C);

    /// An unknown past ends here: w^0 = 1, nothing driven yet, no sums.
    void start();
    /// One sample with known inputs. It counts when its outputs are known too; the filters go on in any case.
    void sample(const double* v);
    /// Do all modes die out fast enough for run()?
    bool settles() const;
    /// The same of `count` samples without a gap at once, from start() on: only products of signals with inputs and outputs are
    /// summed, those of two signals follow from z(t+1) = w z(t) + u(t) on both sides. @return false: there is a gap
    bool run(const double* v, int count);
    void complete_sums();

    /// out += sum over outputs of M_k Z M_l^T for every two modes; Z of two sets of filters, M = [c1 -c2; c2 c1].
    void expand(const double* z, int ldz, double* out, int ldo) const;
    /// out += M_k z of one output.
    void shape(int output, const double* z, double* out) const;

  private:
    bool pair(int k) const { return im_[k] > 0; }
    int size(int k) const { return pair(k) ? 2 : 1; }
    bool sort_modes();
    void advance(double* x) const;
    void flush();
    void place_powers();
    void sum_lanes();
    void two_states(int s, int t);

    okid_real_t *a_, *vectors_, *re_, *im_, *eigen_;
    double *shapes_, *shared_;            // C V, (C V)^T C V
    double *state_, *signals_, *outputs_; // now; a batch of samples
    int waiting_ = 0;
    int blocks_ = 0, lanes_ = 0; // of run(): modes, a pair one; complex states: (group, mode)
    int padded_ = 0;             // modes
    double *powers_, *filter_states_, *filter_sums_, *filter_lags_, *filter_work_; // okid_filters_t
    double* with_v_; // signals times rows, n_u + 2 lanes x n_u + n_y
};

} // namespace okid
