// SPDX-License-Identifier: MIT
// PURPOSE    a model beside another one, its poles and shapes moved to first order
#pragma once
#include <okid/model.h>

#include "identify/triangular.hpp"
#include "linalg/arena.hpp"

#include <complex>

namespace okid {

/// Where a change dA is as large as A itself, the eigenvalues of A + dA say nothing of the derivative that dA stands for.
struct first_order {
    int n_u, n_y, n;
    double *basis, *inverse;     ///< states = basis times modal coordinates, a pair as x + i y: columns Re v, -Im v
    double *A, *B, *C;           ///< of the model: its states; modal
    double *room, *spare, *turn; ///< n x max(n, n_u, n_y); turn: of the eigenvectors, in themselves
    okid_real_t *a, *vectors, *re, *im, *eigen;
    okid_real_t *out_A, *out_B, *out_C;
    bool ready;

    void lay_out(int inputs, int outputs, int largest, arena& memory);
    /// The model that others lie beside. Without independent eigenvectors the others stay as they are.
    void begin(const okid_model_t& model);
    /// `other`, in the same states, in modal coordinates: poles and vectors are those of the model plus their derivative along
    /// the change.
    okid_model_t of(const okid_model_t& other) const;

  private:
    bool pair(int k) const { return im[k] > 0; }
    int size(int k) const { return pair(k) ? 2 : 1; }
    std::complex<double> pole(int k) const { return {double(re[k]), pair(k) ? double(im[k]) : 0.0}; }
    bool invert() const;
    void turn_vectors(int j, int k) const;
};

} // namespace okid
