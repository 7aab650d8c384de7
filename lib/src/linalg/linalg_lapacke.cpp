// SPDX-License-Identifier: MIT
// PURPOSE    linear algebra on the host: LAPACKE (its _work calls only: no heap of its own) on OpenBLAS, one thread
// NUMERICS   LAPACK's; workspace sizes are asked from LAPACK itself
#include "linalg.hpp"

#include <okid/types.h>

#include <algorithm>
#include <cblas.h>
#include <cstring>
#include <lapacke.h>

extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace okid::linalg {

const char* name() { return "lapacke"; }

void warm_up() {
    static const bool done = [] {
        if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
        double a[64], b[64] = {}, c[64] = {};
        for (int i = 0; i < 64; ++i) a[i] = i % 9 == 0 ? 2.0 : 0.1;
        cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, 8, 8, 8, 1, a, 8, b, 8, 0, c, 8);
        LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', 8, a, 8);
        return true;
    }();
    (void)done;
}

int cholesky(int n, double* a, int lda) { return LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', n, a, lda); }

void cholesky_solve(int n, const double* l, int ldl, double* b, int ldb, int count) {
    LAPACKE_dpotrs_work(LAPACK_COL_MAJOR, 'L', n, count, l, ldl, b, ldb);
}

double cholesky_condition(int n, const double* l, int ldl, double norm1, double* work) {
    double reciprocal = 0;
    auto* integers = reinterpret_cast<lapack_int*>(work + 3 * static_cast<std::size_t>(n));
    LAPACKE_dpocon_work(LAPACK_COL_MAJOR, 'L', n, l, ldl, norm1, &reciprocal, work, integers);
    return reciprocal > 0 ? 1 / reciprocal : 1e300;
}

void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, double alpha, const double* a, int lda,
              const double* b, int ldb, double beta, double* c, int ldc) {
    cblas_dgemm(CblasColMajor, transpose_a ? CblasTrans : CblasNoTrans, transpose_b ? CblasTrans : CblasNoTrans, rows,
                cols, inner, alpha, a, lda, b, ldb, beta, c, ldc);
}

// dgesdd: 8 min(rows, cols) integers stand behind its double workspace.
static lapack_int svd_query(int rows, int cols) {
    double wanted = 0, none = 0;
    lapack_int integer = 0;
    const int k = std::min(rows, cols);
    LAPACKE_dgesdd_work(LAPACK_COL_MAJOR, 'S', rows, cols, &none, rows, &none, &none, rows, &none, k, &wanted, -1,
                        &integer);
    return static_cast<lapack_int>(wanted);
}

std::size_t svd_work(int rows, int cols) {
    return static_cast<std::size_t>(svd_query(rows, cols)) + 8 * static_cast<std::size_t>(std::min(rows, cols));
}

int svd(int rows, int cols, double* a, double* u, double* s, double* vt, double* work) {
    const int k = std::min(rows, cols);
    const lapack_int size = svd_query(rows, cols);
    auto* integers = reinterpret_cast<lapack_int*>(work + size);
    return LAPACKE_dgesdd_work(LAPACK_COL_MAJOR, 'S', rows, cols, a, rows, s, u, rows, vt, k, work, size, integers);
}

static lapack_int eigen_query(int n) {
    double wanted = 0, none = 0;
    LAPACKE_dgeev_work(LAPACK_COL_MAJOR, 'N', 'V', n, &none, n, &none, &none, &none, 1, &none, n, &wanted, -1);
    return static_cast<lapack_int>(wanted);
}

std::size_t eigen_work(int n) { return static_cast<std::size_t>(eigen_query(n)); }

int eigen(int n, double* a, double* re, double* im, double* vectors, double* work) {
    return LAPACKE_dgeev_work(LAPACK_COL_MAJOR, 'N', vectors != nullptr ? 'V' : 'N', n, a, n, re, im, nullptr, 1,
                              vectors, n, work, eigen_query(n));
}

} // namespace okid::linalg

extern "C" const char* okid_backend(void) { return okid::linalg::name(); }
