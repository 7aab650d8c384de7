// SPDX-License-Identifier: MIT
// PURPOSE    the one seam between the library and its linear algebra; two backends of the same shape
//            (linalg_lapacke.cpp for hosts, linalg_eigen.cpp for fixed memory without LAPACK)
// RULES      column-major, caller's memory, no heap after warm_up(), no exceptions; int results: 0 ok, else the failure
#pragma once
#include <cstddef>

namespace okid::linalg {

/// "lapacke" or "eigen".
const char* name();

/// Anything the backend allocates once (BLAS buffers, thread count 1) happens here, in create, not later.
void warm_up();

/// A (n x n, lower triangle) -> L with A = L L^T. @return 0, or the 1-based column whose pivot is not positive
int cholesky(int n, double* a, int lda);

/// B <- A^-1 B with the factor of cholesky(); b is n x count.
void cholesky_solve(int n, const double* l, int ldl, double* b, int ldb, int count);

/// 1-norm condition estimate of A from its factor and the 1-norm of A. work: 4 n doubles.
double cholesky_condition(int n, const double* l, int ldl, double norm1, double* work);

/// C <- alpha op(A) op(B) + beta C; C is rows x cols, inner products of length `inner`.
void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, double alpha, const double* a, int lda,
              const double* b, int ldb, double beta, double* c, int ldc);

/// Economy SVD A (rows x cols) = U diag(s) V^T with k = min(rows, cols); A is destroyed.
/// u: rows x k (ld rows), s: k descending, vt: k x cols (ld k). work: svd_work(rows, cols) doubles.
std::size_t svd_work(int rows, int cols);
int svd(int rows, int cols, double* a, double* u, double* s, double* vt, double* work);

/// Eigenvalues of a general real n x n matrix (destroyed), and right eigenvectors unless vectors is nullptr: a complex
/// pair k, k+1 has eigenvector vectors(:,k) +- i vectors(:,k+1). work: eigen_work(n) doubles.
std::size_t eigen_work(int n);
int eigen(int n, double* a, double* re, double* im, double* vectors, double* work);

} // namespace okid::linalg
