// SPDX-License-Identifier: MIT
// PURPOSE    linear algebra on the host: LAPACKE (its _work calls only: no heap of its own) on OpenBLAS, one thread
// METHOD     LAPACK's d and s routines under one overloaded name each, below templates of linalg.hpp; eigenvalues alone by
//            francis.hpp, single eigenvectors by inverse_iteration.hpp
// NUMERICS   LAPACK's; workspace sizes are asked from LAPACK itself
#include "linalg.hpp"

#include "cholesky.h"
#include "condition.hpp"
#include "francis.hpp"
#include "inverse_iteration.hpp"

#include <algorithm>
#include <cblas.h>
#include <cmath>
#include <lapacke.h>
#include <type_traits>

extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace okid::linalg {
namespace {

using std::size_t;
constexpr int layout = LAPACK_COL_MAJOR;

lapack_int potrf(int n, double* a, int lda) { return LAPACKE_dpotrf_work(layout, 'L', n, a, lda); }
lapack_int potrf(int n, float* a, int lda) { return LAPACKE_spotrf_work(layout, 'L', n, a, lda); }

void potrs(int n, int count, const double* l, int ldl, double* b, int ldb) {
    LAPACKE_dpotrs_work(layout, 'L', n, count, l, ldl, b, ldb);
}
void potrs(int n, int count, const float* l, int ldl, float* b, int ldb) {
    LAPACKE_spotrs_work(layout, 'L', n, count, l, ldl, b, ldb);
}

void trsv(CBLAS_TRANSPOSE t, int n, const double* l, int ldl, double* x) {
    cblas_dtrsv(CblasColMajor, CblasLower, t, CblasNonUnit, n, l, ldl, x, 1);
}
void trsv(CBLAS_TRANSPOSE t, int n, const float* l, int ldl, float* x) {
    cblas_strsv(CblasColMajor, CblasLower, t, CblasNonUnit, n, l, ldl, x, 1);
}

void gemm(CBLAS_TRANSPOSE ta, CBLAS_TRANSPOSE tb, int rows, int cols, int inner, double alpha, const double* a, int lda,
          const double* b, int ldb, double beta, double* c, int ldc) {
    cblas_dgemm(CblasColMajor, ta, tb, rows, cols, inner, alpha, a, lda, b, ldb, beta, c, ldc);
}
void gemm(CBLAS_TRANSPOSE ta, CBLAS_TRANSPOSE tb, int rows, int cols, int inner, float alpha, const float* a, int lda,
          const float* b, int ldb, float beta, float* c, int ldc) {
    cblas_sgemm(CblasColMajor, ta, tb, rows, cols, inner, alpha, a, lda, b, ldb, beta, c, ldc);
}

lapack_int gesdd(int rows, int cols, double* a, double* s, double* u, double* vt, int k, double* work, lapack_int size,
                 lapack_int* integers) {
    return LAPACKE_dgesdd_work(layout, 'S', rows, cols, a, rows, s, u, rows, vt, k, work, size, integers);
}
lapack_int gesdd(int rows, int cols, float* a, float* s, float* u, float* vt, int k, float* work, lapack_int size,
                 lapack_int* integers) {
    return LAPACKE_sgesdd_work(layout, 'S', rows, cols, a, rows, s, u, rows, vt, k, work, size, integers);
}

lapack_int geev(int n, double* a, double* re, double* im, double* right, double* work, lapack_int size) {
    return LAPACKE_dgeev_work(layout, 'N', 'V', n, a, n, re, im, nullptr, 1, right, n, work, size);
}
lapack_int geev(int n, float* a, float* re, float* im, float* right, float* work, lapack_int size) {
    return LAPACKE_sgeev_work(layout, 'N', 'V', n, a, n, re, im, nullptr, 1, right, n, work, size);
}

lapack_int gebal(int n, double* a, lapack_int* low, lapack_int* high, double* scale) {
    return LAPACKE_dgebal_work(layout, 'B', n, a, n, low, high, scale);
}
lapack_int gebal(int n, float* a, lapack_int* low, lapack_int* high, float* scale) {
    return LAPACKE_sgebal_work(layout, 'B', n, a, n, low, high, scale);
}

lapack_int gebak(int n, lapack_int low, lapack_int high, const double* scale, double* pair) {
    return LAPACKE_dgebak_work(layout, 'B', 'R', n, low, high, scale, 2, pair, n);
}
lapack_int gebak(int n, lapack_int low, lapack_int high, const float* scale, float* pair) {
    return LAPACKE_sgebak_work(layout, 'B', 'R', n, low, high, scale, 2, pair, n);
}

lapack_int gehrd(int n, lapack_int low, lapack_int high, double* a, double* tau, double* work, lapack_int size) {
    return LAPACKE_dgehrd_work(layout, n, low, high, a, n, tau, work, size);
}
lapack_int gehrd(int n, lapack_int low, lapack_int high, float* a, float* tau, float* work, lapack_int size) {
    return LAPACKE_sgehrd_work(layout, n, low, high, a, n, tau, work, size);
}

/// LAPACK answers a query in Real: above 2^24 a float may be rounded down, the next one is enough.
template <class Real> lapack_int whole(Real wanted) {
    return static_cast<lapack_int>(std::nextafter(wanted, std::numeric_limits<Real>::infinity()));
}

/// What LAPACK answers for these sizes; a thread asks for the same few again and again.
template <class Ask> lapack_int remembered(int a, int b, Ask ask) {
    struct answer {
        int a, b;
        lapack_int size;
    };
    static thread_local answer known[4] = {};
    static thread_local unsigned oldest = 0;
    for (const answer& one : known)
        if (one.a == a && one.b == b) return one.size; // no size is 0
    answer& next = known[oldest++ % 4];
    next = {a, b, ask()};
    return next.size;
}

template <class Real> lapack_int svd_query(int rows, int cols) {
    return remembered(rows, cols, [&] {
        Real wanted = 0, none = 0;
        lapack_int integer = 0;
        gesdd(rows, cols, &none, &none, &none, &none, std::min(rows, cols), &wanted, -1, &integer);
        return whole(wanted);
    });
}

template <class Real> lapack_int eigen_query(int n) {
    return remembered(n, 0, [&] {
        Real wanted = 0, none = 0;
        geev(n, &none, &none, &none, &none, &wanted, -1);
        return whole(wanted);
    });
}

/// Does another eigenvalue stand so near that both have one vector to half the digits?
template <class Real> bool crowded(int n, int k, const Real* re, const Real* im, Real near) {
    for (int j = 0; j < n; ++j)
        if (j != k && std::abs(re[j] - re[k]) + std::abs(im[j] - im[k]) < near) return true;
    return false;
}

/// A pair of columns as geev leaves it: of unit length, its largest entry real.
template <class Real> void scale_pair(int n, Real* x, Real* y) {
    Real sum = 0, largest = 0;
    int at = 0;
    for (int i = 0; i < n; ++i) {
        const Real square = x[i] * x[i] + y[i] * y[i];
        sum += square;
        if (square > largest) largest = square, at = i;
    }
    if (!(largest > 0)) return;
    const Real size = std::sqrt(sum) * std::sqrt(largest), c = x[at] / size, s = y[at] / size;
    for (int i = 0; i < n; ++i) {
        const Real p = x[i];
        x[i] = p * c + y[i] * s;
        y[i] = y[i] * c - p * s;
    }
    y[at] = 0;
}

/// How a matrix was balanced and brought to Hessenberg form; the reflectors stand below the form.
template <class Real> struct hessenberg_form {
    Real *scale, *tau; // n each
    lapack_int low, high;

    bool reduce(int n, Real* a, Real* work, lapack_int size) {
        return gebal(n, a, &low, &high, scale) == 0 && gehrd(n, low, high, a, tau, work, size) == 0;
    }
};

/// All eigenvalues, and the vectors of the pairs that are wanted, by inverse iteration: half the work of all vectors where
/// half of them are wanted. @return false: that cannot be done here, and a stands as it was
template <class Real>
bool wanted_pairs(int n, const Real* a, Real* re, Real* im, Real* vectors, Real* work, wanted_eigenvalue<Real> wanted) {
    const auto length = static_cast<size_t>(n), square = length * length;
    Real *reduced = work, *h = reduced + square, *inverse = h + square,
         *rest = inverse + inverse_iteration<Real>::work(n);
    hessenberg_form<Real> form{rest, rest + length, 1, n};
    std::copy(a, a + square, reduced);
    if (!form.reduce(n, reduced, rest + 2 * length, eigen_query<Real>(n))) return false;
    std::copy(reduced, reduced + square, h);
    if (!francis<Real>(n, h).find(re, im)) return false;
    const inverse_iteration<Real> by(n, reduced, inverse);
    const Real near = std::sqrt(std::numeric_limits<Real>::epsilon()) * by.norm();
    for (int k = 0; k < n; ++k) {
        if (!(im[k] > 0) || !wanted(re[k], im[k])) continue;
        Real* pair = vectors + static_cast<size_t>(k) * length;
        if (crowded(n, k, re, im, near) || !by.find(re[k], im[k], pair, pair + n)) return false;
        turn_back(n, reduced, form.tau, pair);
        if (gebak(n, form.low, form.high, form.scale, pair) != 0) return false;
        scale_pair(n, pair, pair + n);
    }
    return true;
}

/// Up to here each of k vectors of n by itself costs less than all of them by divide and conquer.
bool few(int n, int k) { return 3 * k <= 2 * n; }

lapack_int syevd_query(int n, lapack_int* integers) {
    double wanted = 0, none = 0;
    LAPACKE_dsyevd_work(layout, 'V', 'L', n, &none, n, &none, &wanted, -1, integers, -1);
    return whole(wanted);
}

void reverse_columns(int n, int k, double* vectors) {
    for (int j = 0; j < k / 2; ++j)
        std::swap_ranges(vectors + static_cast<size_t>(j) * static_cast<size_t>(n),
                         vectors + static_cast<size_t>(j + 1) * static_cast<size_t>(n),
                         vectors + static_cast<size_t>(k - 1 - j) * static_cast<size_t>(n));
}

/// Inverse iteration takes the form for irreducible: no subdiagonal entry below one rounding of the largest entry.
void couple(int n, const double* d, double* e) {
    double largest = 0;
    for (int k = 0; k < n; ++k) largest = std::max(largest, std::abs(d[k]));
    for (int k = 0; k + 1 < n; ++k) largest = std::max(largest, std::abs(e[k]));
    const double least = std::numeric_limits<double>::epsilon() * largest;
    for (int k = 0; k + 1 < n; ++k)
        if (std::abs(e[k]) < least) e[k] = least;
}

/// The eigenvector of the form (d, e) to the eigenvalue nearest `value`, of unit length: the factorisations from both ends meet
/// where that leaves least. Dhillon, Parlett (2004). ahead, back: n numbers each
void twisted_vector(int n, const double* d, const double* e, double value, double least, double* vector, double* ahead,
                    double* back) {
    const auto safe = [&](double pivot) { return std::abs(pivot) < least ? std::copysign(least, pivot) : pivot; };
    ahead[0] = safe(d[0] - value);
    for (int i = 1; i < n; ++i) ahead[i] = safe(d[i] - value - e[i - 1] / ahead[i - 1] * e[i - 1]);
    back[n - 1] = safe(d[n - 1] - value);
    for (int i = n - 2; i >= 0; --i) back[i] = safe(d[i] - value - e[i] / back[i + 1] * e[i]);
    const auto left = [&](int i) { return std::abs(ahead[i] + back[i] - (d[i] - value)); };
    int meet = 0;
    for (int i = 1; i < n; ++i)
        if (left(i) < left(meet)) meet = i;
    constexpr double denormal = 1e-150;
    const auto kept = [&](double x) { return std::abs(x) < denormal ? 0 : x; };
    vector[meet] = 1;
    for (int i = meet - 1; i >= 0; --i) vector[i] = kept(-e[i] / ahead[i] * vector[i + 1]);
    for (int i = meet + 1; i < n; ++i) vector[i] = kept(-e[i - 1] / back[i] * vector[i - 1]);
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += vector[i] * vector[i];
    const double scale = 1 / std::sqrt(sum);
    for (int i = 0; i < n; ++i) vector[i] *= scale;
}

/// Do the columns stand upright on each other? Close eigenvalues give leaning ones.
bool upright(int n, int k, const double* vectors, double* products) {
    gemm(CblasTrans, CblasNoTrans, k, k, n, 1.0, vectors, n, vectors, n, 0.0, products, k);
    for (int j = 0; j < k; ++j)
        for (int i = 0; i < j; ++i)
            if (!(std::abs(products[j * k + i]) < 1e-13 * n)) return false;
    return true;
}

/// Of the reduction to tridiagonal form and of the way back.
lapack_int few_query(int n, int k) {
    double down = 0, back = 0, none = 0;
    LAPACKE_dsytrd_work(layout, 'L', n, &none, n, &none, &none, &none, &down, -1);
    LAPACKE_dormtr_work(layout, 'L', 'L', 'N', n, k, &none, n, &none, &none, n, &back, -1);
    return std::max(whole(down), whole(back));
}

/// Doubles: d, e, tau; what LAPACK takes; work of one eigenvector after the other.
size_t few_work(int n, int k) {
    const auto length = static_cast<size_t>(n);
    return 3 * length + static_cast<size_t>(few_query(n, k)) +
           std::max(5 * length, static_cast<size_t>(k) * static_cast<size_t>(k)) + 4 * length;
}

/// Tridiagonal form in the place of a, all its eigenvalues, the wanted eigenvectors each by itself; by inverse iteration where some
/// are close.
int symmetric_few(int n, double* a, int k, double* values, double* vectors, double* work) {
    const auto length = static_cast<size_t>(n);
    const lapack_int size = few_query(n, k);
    double *d = work, *e = d + length, *tau = e + length, *blocks = tau + length, *own = blocks + size,
           *behind = own + std::max(5 * length, static_cast<size_t>(k) * static_cast<size_t>(k));
    if (LAPACKE_dsytrd_work(layout, 'L', n, a, n, d, e, tau, blocks, size) != 0) return 1;
    couple(n, d, e);
    std::copy(d, d + n, values);
    std::copy(e, e + n - 1, own);
    if (LAPACKE_dsterf_work(n, values, own) != 0) return 1;
    const double least =
        std::numeric_limits<double>::epsilon() * std::max(std::abs(values[0]), std::abs(values[n - 1]));
    for (int j = 0; j < k; ++j)
        twisted_vector(n, d, e, values[n - k + j], least, vectors + static_cast<size_t>(j) * length, own, own + n);
    if (!upright(n, k, vectors, own)) {
        auto* block = reinterpret_cast<lapack_int*>(behind);
        lapack_int *end = block + n, *integers = end + n, *failed = integers + n;
        std::fill(block, block + n, 1);
        *end = n;
        if (LAPACKE_dstein_work(layout, n, d, e, k, values + n - k, block, end, vectors, n, own, integers, failed) != 0)
            return 1;
    }
    if (LAPACKE_dormtr_work(layout, 'L', 'L', 'N', n, k, a, n, tau, vectors, n, blocks, size) != 0) return 1;
    reverse_columns(n, k, vectors);
    return 0;
}

/// One call of each kernel, so that OpenBLAS takes its buffers now.
template <class Real> void touch() {
    Real a[64], b[64] = {}, c[64] = {};
    for (int i = 0; i < 64; ++i) a[i] = i % 9 == 0 ? Real(2) : Real(0.1);
    gemm(CblasNoTrans, CblasNoTrans, 8, 8, 8, 1, a, 8, b, 8, 0, c, 8);
    potrf(8, a, 8);
}

} // namespace

const char* name() { return "lapacke"; }

void warm_up() {
    static const bool done = [] {
        if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
        touch<double>();
        touch<float>();
        return true;
    }();
    (void)done;
}

template <class Real> int cholesky(int n, Real* a, int lda) {
    if constexpr (std::is_same_v<Real, double>)
        if (okid_cholesky_fn* own = okid_cholesky_pick(n)) return own(n, a, static_cast<size_t>(lda));
    return potrf(n, a, lda);
}

template <class Real> void cholesky_solve(int n, const Real* l, int ldl, Real* b, int ldb, int count) {
    potrs(n, count, l, ldl, b, ldb);
}

template <class Real> Real cholesky_condition(int n, const Real* l, int ldl, as_is<Real> norm1, Real* work) {
    return condition_of_solve<Real>(n, norm1, work, [&](Real* y) {
        trsv(CblasNoTrans, n, l, ldl, y);
        trsv(CblasTrans, n, l, ldl, y);
    });
}

template <class Real>
void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, as_is<Real> alpha, const Real* a,
              int lda, const Real* b, int ldb, as_is<Real> beta, Real* c, int ldc) {
    gemm(transpose_a ? CblasTrans : CblasNoTrans, transpose_b ? CblasTrans : CblasNoTrans, rows, cols, inner, alpha, a,
         lda, b, ldb, beta, c, ldc);
}

// gesdd: 8 min(rows, cols) integers stand behind its workspace of numbers.
static_assert(sizeof(lapack_int) <= sizeof(float));
template <class Real> size_t svd_work(int rows, int cols) {
    return static_cast<size_t>(svd_query<Real>(rows, cols)) + 8 * static_cast<size_t>(std::min(rows, cols));
}

template <class Real> int svd(int rows, int cols, Real* a, Real* u, Real* s, Real* vt, Real* work) {
    const lapack_int size = svd_query<Real>(rows, cols);
    auto* integers = reinterpret_cast<lapack_int*>(work + size);
    return gesdd(rows, cols, a, s, u, vt, std::min(rows, cols), work, size, integers);
}

size_t symmetric_work(int n, int k) {
    const size_t of_few = few_work(n, std::min(k, 2 * n / 3));
    if (few(n, k)) return of_few;
    lapack_int integers = 0;
    const lapack_int size = syevd_query(n, &integers);
    return std::max(of_few, static_cast<size_t>(size) + static_cast<size_t>(integers));
}

int symmetric(int n, double* a, int k, double* values, double* vectors, double* work) {
    if (few(n, k)) {
        if (symmetric_few(n, a, k, values, vectors, work) != 0) return 1;
    } else {
        lapack_int integers = 0;
        const lapack_int size = syevd_query(n, &integers);
        if (LAPACKE_dsyevd_work(layout, 'V', 'L', n, a, n, values, work, size,
                                reinterpret_cast<lapack_int*>(work + size), integers) != 0)
            return 1;
        const size_t from = static_cast<size_t>(n - k) * static_cast<size_t>(n);
        std::copy(a + from, a + static_cast<size_t>(n) * static_cast<size_t>(n), vectors);
        reverse_columns(n, k, vectors);
    }
    std::reverse(values, values + n);
    return 0;
}

template <class Real> size_t eigen_work(int n, bool with_vectors) {
    const auto size = static_cast<size_t>(n);
    return (with_vectors ? 2 * size * size + inverse_iteration<Real>::work(n) : 0) + 2 * size +
           static_cast<size_t>(eigen_query<Real>(n));
}

template <class Real>
int eigen(int n, Real* a, Real* re, Real* im, as_is<Real*> vectors, Real* work, as_is<wanted_eigenvalue<Real>> wanted) {
    const lapack_int size = eigen_query<Real>(n);
    if (vectors != nullptr) {
        if (wanted != nullptr && wanted_pairs<Real>(n, a, re, im, vectors, work, wanted)) return 0;
        return geev(n, a, re, im, vectors, work, size);
    }
    hessenberg_form<Real> form{work, work + n, 1, n};
    if (!form.reduce(n, a, work + 2 * n, size)) return 1;
    return francis<Real>(n, a).find(re, im) ? 0 : 1;
}

template int cholesky(int, double*, int);
template void cholesky_solve(int, const double*, int, double*, int, int);
template double cholesky_condition(int, const double*, int, double, double*);
template void multiply(bool, bool, int, int, int, double, const double*, int, const double*, int, double, double*, int);
template size_t svd_work<double>(int, int);
template int svd(int, int, double*, double*, double*, double*, double*);
template size_t eigen_work<double>(int, bool);
template int eigen(int, double*, double*, double*, double*, double*, wanted_eigenvalue<double>);

template int cholesky(int, float*, int);
template void cholesky_solve(int, const float*, int, float*, int, int);
template float cholesky_condition(int, const float*, int, float, float*);
template void multiply(bool, bool, int, int, int, float, const float*, int, const float*, int, float, float*, int);
template size_t svd_work<float>(int, int);
template int svd(int, int, float*, float*, float*, float*, float*);
template size_t eigen_work<float>(int, bool);
template int eigen(int, float*, float*, float*, float*, float*, wanted_eigenvalue<float>);

} // namespace okid::linalg

extern "C" const char* okid_backend(void) { return okid::linalg::name(); }
