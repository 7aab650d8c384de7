// SPDX-License-Identifier: MIT
// PURPOSE    the one seam between the library and its linear algebra; two backends of the same shape
//            (linalg_lapacke.cpp for hosts, linalg_eigen.cpp for fixed memory without LAPACK)
// RULES      column-major, caller's memory, no heap after warm_up(), no exceptions; int results: 0 ok, else the failure.
//            Real is double or float, after the pointers. Every build has all of it for okid_real_t, and what the
//            normal equations need (multiply, cholesky…) for double
#pragma once
#include <okid/types.h>

#include <cstddef>
#include <limits>
#include <type_traits>

namespace okid::linalg {

/// A limit near rounding, stated for double, in as many rounding units of Real (the very number where Real is double).
template <class Real> constexpr Real limit_of(double in_double) {
    return static_cast<Real>(in_double / std::numeric_limits<double>::epsilon()) * std::numeric_limits<Real>::epsilon();
}

/// A parameter that takes part in no deduction: constants and nullptr convert to what the other pointers say.
template <class T> using as_is = std::common_type_t<T>;

/// "lapacke" or "eigen".
const char* name();

/// Anything the backend allocates once (BLAS buffers, thread count 1) happens here, in create, not later.
void warm_up();

/// A (n x n, lower triangle) -> L with A = L L^T; then the upper triangle is undefined.
/// @return 0, or the 1-based column whose pivot is not positive
template <class Real> int cholesky(int n, Real* a, int lda);

/// B <- A^-1 B with the factor of cholesky(); b is n x count.
template <class Real> void cholesky_solve(int n, const Real* l, int ldl, Real* b, int ldb, int count);

/// 1-norm condition estimate of A from its factor and the 1-norm of A. work: 2 n numbers.
template <class Real> Real cholesky_condition(int n, const Real* l, int ldl, as_is<Real> norm1, Real* work);

/// C <- alpha op(A) op(B) + beta C; C is rows x cols, inner products of length `inner`.
template <class Real>
void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, as_is<Real> alpha, const Real* a,
              int lda, const Real* b, int ldb, as_is<Real> beta, Real* c, int ldc);

/// Economy SVD A (rows x cols) = U diag(s) V^T with k = min(rows, cols); A is destroyed.
/// u: rows x k (ld rows), s: k descending, vt: k x cols (ld k). work: svd_work(rows, cols) numbers.
template <class Real = okid_real_t> std::size_t svd_work(int rows, int cols);
template <class Real> int svd(int rows, int cols, Real* a, Real* u, Real* s, Real* vt, Real* work);

/// Symmetric A (n x n, not zero, lower triangle; destroyed): its n eigenvalues, descending, and the eigenvectors of the k largest
/// (n x k, ld n). Small eigenvalues have the absolute error of the large ones. work: symmetric_work(n, k) numbers,
/// which suffice for fewer vectors too.
std::size_t symmetric_work(int n, int k);
int symmetric(int n, double* a, int k, double* values, double* vectors, double* work);

/// Eigenvalues of a general real n x n matrix (destroyed), and right eigenvectors unless vectors is nullptr: a complex
/// pair k, k+1 has eigenvector vectors(:,k) +- i vectors(:,k+1). With `wanted` only pairs for whose first eigenvalue
/// (im > 0) it is true have vectors; the other columns are undefined. work: eigen_work(n) numbers; eigen_work(n, false) do
/// where vectors is nullptr.
template <class Real> using wanted_eigenvalue = bool (*)(Real re, Real im);
template <class Real = okid_real_t> std::size_t eigen_work(int n, bool with_vectors = true);
template <class Real>
int eigen(int n, Real* a, Real* re, Real* im, as_is<Real*> vectors, Real* work,
          as_is<wanted_eigenvalue<Real>> wanted = nullptr);

} // namespace okid::linalg
