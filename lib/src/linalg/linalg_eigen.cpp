// SPDX-License-Identifier: MIT
// PURPOSE    linear algebra without LAPACK and without a heap: Eigen's expressions and in-place kernels on caller's memory
// METHOD     right-looking blocked Cholesky; Householder QR and one-sided Jacobi SVD; Hessenberg reduction and shifted QR
//            on the real Schur form with back-substituted eigenvectors
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 4.2, 5.2, 7.5-7.6; one-sided Jacobi: Hestenes (1958)
// NUMERICS   backward stable; one-sided Jacobi gives small singular values to high relative accuracy
// WORKSPACE  as linalg.hpp states; products are lazy (coefficient-based), so that Eigen asks for no temporaries.
//            Instantiated is what a build uses and no more: code memory of a microcontroller
#include "linalg.hpp"

#include "condition.hpp"

#include <Eigen/Core>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>

namespace okid::linalg {
namespace {

using std::size_t;
using stride = Eigen::OuterStride<>;
template <class Real> using dense_matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
template <class Real> using dense_vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
template <class Real> using matrix = Eigen::Map<dense_matrix<Real>, 0, stride>;
template <class Real> using const_matrix = Eigen::Map<const dense_matrix<Real>, 0, stride>;
template <class Real> using vector = Eigen::Map<dense_vector<Real>>;
constexpr int block = 32;

template <class Real> matrix<Real> view(Real* a, int rows, int cols, int ld) { return {a, rows, cols, stride(ld)}; }
template <class Real> const_matrix<Real> view(const Real* a, int rows, int cols, int ld) {
    return {a, rows, cols, stride(ld)};
}

/// A stand-in for zero that may still be divided by: 1e-300 in double, as far above the smallest number in float.
template <class Real>
constexpr Real nothing =
    static_cast<Real>(1e-300 / std::numeric_limits<double>::min()) * std::numeric_limits<Real>::min();

/// C -= A B^T for the lower triangle of C, in strips, without a temporary.
template <class Target, class Panel> void subtract_outer(Target c, const Panel& panel) {
    const int n = static_cast<int>(c.rows());
    for (int j = 0; j < n; j += block) {
        const int width = std::min(block, n - j);
        c.block(j, j, n - j, width).noalias() -=
            panel.bottomRows(n - j).lazyProduct(panel.middleRows(j, width).transpose());
    }
}

/// Householder vector that maps x (length n) to beta e1; x(1..) becomes v(1..), v(0) = 1. @return tau
template <class Real> Real reflector(Real* x, int n, Real* beta) {
    vector<Real> tail(x + 1, n - 1);
    const Real alpha = x[0], rest = n > 1 ? tail.squaredNorm() : 0;
    if (!(rest > 0)) {
        *beta = alpha;
        return 0;
    }
    *beta = -std::copysign(std::sqrt(alpha * alpha + rest), alpha);
    tail /= alpha - *beta;
    return (*beta - alpha) / *beta;
}

/// A <- (I - tau v v^T) A, v = [1; tail].
template <class Real> void reflect_left(Real* a, int lda, int rows, int cols, const Real* tail, Real tau) {
    if (tau == 0) return;
    Eigen::Map<const dense_vector<Real>> v(tail, rows - 1);
    for (int j = 0; j < cols; ++j) {
        Real* column = a + static_cast<size_t>(j) * static_cast<size_t>(lda);
        vector<Real> rest(column + 1, rows - 1);
        const Real w = tau * (column[0] + v.dot(rest));
        column[0] -= w;
        rest.noalias() -= w * v;
    }
}

/// A <- A (I - tau v v^T).
template <class Real> void reflect_right(Real* a, int lda, int rows, int cols, const Real* tail, Real tau) {
    if (tau == 0) return;
    for (int i = 0; i < rows; ++i) {
        Real w = a[i];
        for (int j = 1; j < cols; ++j)
            w += a[static_cast<size_t>(j) * static_cast<size_t>(lda) + static_cast<size_t>(i)] * tail[j - 1];
        w *= tau;
        a[i] -= w;
        for (int j = 1; j < cols; ++j)
            a[static_cast<size_t>(j) * static_cast<size_t>(lda) + static_cast<size_t>(i)] -= w * tail[j - 1];
    }
}

} // namespace

const char* name() { return "eigen"; }
void warm_up() {}

template <class Real> int cholesky(int n, Real* a, int lda) {
    for (int k = 0; k < n; k += block) {
        const int width = std::min(block, n - k), below = n - k - width;
        matrix<Real> d = view(a + static_cast<size_t>(k) * static_cast<size_t>(lda) + k, width + below, width, lda);
        for (int j = 0; j < width; ++j) {
            for (int c = 0; c < j; ++c) d.col(j).tail(width + below - j) -= d(j, c) * d.col(c).tail(width + below - j);
            if (!(d(j, j) > 0)) return k + j + 1;
            d.col(j).tail(width + below - j) /= std::sqrt(d(j, j));
        }
        if (below > 0)
            subtract_outer(
                view(a + static_cast<size_t>(k + width) * static_cast<size_t>(lda) + k + width, below, below, lda),
                d.bottomRows(below));
    }
    return 0;
}

template <class Real> void cholesky_solve(int n, const Real* l, int ldl, Real* b, int ldb, int count) {
    const const_matrix<Real> L = view(l, n, n, ldl);
    for (int c = 0; c < count; ++c) {
        vector<Real> x(b + static_cast<size_t>(c) * static_cast<size_t>(ldb), n);
        for (int j = 0; j < n; ++j) {
            x[j] /= L(j, j);
            x.tail(n - j - 1) -= x[j] * L.col(j).tail(n - j - 1);
        }
        for (int j = n - 1; j >= 0; --j) x[j] = (x[j] - L.col(j).tail(n - j - 1).dot(x.tail(n - j - 1))) / L(j, j);
    }
}

template <class Real> Real cholesky_condition(int n, const Real* l, int ldl, as_is<Real> norm1, Real* work) {
    return condition_of_solve<Real>(n, norm1, work, [&](Real* y) { cholesky_solve(n, l, ldl, y, n, 1); });
}

template <class Real>
void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, as_is<Real> alpha, const Real* a,
              int lda, const Real* b, int ldb, as_is<Real> beta, Real* c, int ldc) {
    matrix<Real> C = view(c, rows, cols, ldc);
    if (beta == 0)
        C.setZero();
    else if (beta != 1)
        C *= beta;
    const const_matrix<Real> A = view(a, transpose_a ? inner : rows, transpose_a ? rows : inner, lda);
    const const_matrix<Real> B = view(b, transpose_b ? cols : inner, transpose_b ? inner : cols, ldb);
    for (int k = 0; k < inner; k += 256) { // strips keep the operands in cache; no packing, hence no temporaries
        const int depth = std::min(256, inner - k);
        if (!transpose_a && !transpose_b)
            for (int j = 0; j < cols; ++j)
                for (int i = k; i < k + depth; ++i) C.col(j) += (alpha * B(i, j)) * A.col(i);
        else if (!transpose_a)
            for (int j = 0; j < cols; ++j)
                for (int i = k; i < k + depth; ++i) C.col(j) += (alpha * B(j, i)) * A.col(i);
        else if (!transpose_b)
            C.noalias() += alpha * A.middleRows(k, depth).transpose().lazyProduct(B.middleRows(k, depth));
        else
            C.noalias() += alpha * A.middleRows(k, depth).transpose().lazyProduct(B.middleCols(k, depth).transpose());
    }
}

// ---- SVD: QR of the taller side first, then one-sided Jacobi on the square factor -------------------------------------

template <class Real> size_t svd_work(int rows, int cols) {
    const auto tall = static_cast<size_t>(std::max(rows, cols)), k = static_cast<size_t>(std::min(rows, cols));
    return tall * k + 2 * k * k + 2 * k;
}

namespace {

/// One-sided Jacobi of g (k x k): columns become orthogonal, v collects the rotations.
template <class Real> bool jacobi(matrix<Real> g, matrix<Real> v) {
    const int k = static_cast<int>(g.cols());
    // The matrix is of size 1: columns shorter than its rounding are left as they are. Turned against each other they
    // would stay rounding, of another direction in every sweep.
    constexpr Real orthogonal = limit_of<Real>(1e-15), rounding = std::numeric_limits<Real>::epsilon();
    v.setIdentity();
    for (int sweep = 0; sweep < 60; ++sweep) {
        bool still = false;
        for (int p = 0; p + 1 < k; ++p)
            for (int q = p + 1; q < k; ++q) {
                const Real pp = g.col(p).squaredNorm(), qq = g.col(q).squaredNorm(), pq = g.col(p).dot(g.col(q));
                if (std::min(pp, qq) < rounding * rounding || std::abs(pq) <= orthogonal * std::sqrt(pp * qq)) continue;
                still = true;
                const Real tau = (qq - pp) / (2 * pq);
                const Real t = std::copysign(1 / (std::abs(tau) + std::sqrt(1 + tau * tau)), tau);
                const Real c = 1 / std::sqrt(1 + t * t);
                const Eigen::JacobiRotation<Real> rotation(c, c * t);
                g.applyOnTheRight(p, q, rotation);
                v.applyOnTheRight(p, q, rotation);
            }
        if (!still) return true;
    }
    return false;
}

/// Order columns of g and v by the length of g's columns, which become the singular values; g's columns turn to unit.
template <class Real> void sort_columns(matrix<Real> g, matrix<Real> v, Real* s) {
    const int k = static_cast<int>(g.cols());
    for (int j = 0; j < k; ++j) s[j] = g.col(j).norm();
    for (int j = 0; j < k; ++j) {
        const int best = static_cast<int>(std::max_element(s + j, s + k) - s);
        std::swap(s[j], s[best]);
        if (best != j) {
            g.col(j).swap(g.col(best));
            v.col(j).swap(v.col(best));
        }
        if (s[j] > 0) g.col(j) /= s[j];
    }
}

} // namespace

template <class Real> int svd(int rows, int cols, Real* a, Real* u, Real* s, Real* vt, Real* work) {
    const bool wide = cols > rows;
    const int tall = std::max(rows, cols), k = std::min(rows, cols);
    Real *q = work, *g = q + static_cast<size_t>(tall) * static_cast<size_t>(k),
         *v = g + static_cast<size_t>(k) * static_cast<size_t>(k);
    Real* tau = v + static_cast<size_t>(k) * static_cast<size_t>(k);
    if (wide)
        view(q, tall, k, tall) = view(a, rows, cols, rows).transpose();
    else
        view(q, tall, k, tall) = view(a, rows, cols, rows);
    // Largest entry between 1/2 and 1 by a power of two, without rounding: squares stay in the range of Real in any unit.
    int exponent = 0;
    std::frexp(view(q, tall, k, tall).cwiseAbs().maxCoeff(), &exponent);
    exponent = std::max(exponent, std::numeric_limits<Real>::min_exponent);
    view(q, tall, k, tall) *= std::ldexp(Real(1), -exponent);
    for (int j = 0; j < k; ++j) {
        Real* x = q + static_cast<size_t>(j) * static_cast<size_t>(tall) + j;
        Real beta = 0;
        tau[j] = reflector(x, tall - j, &beta);
        reflect_left(x + tall, tall, tall - j, k - j - 1, x + 1, tau[j]);
        *x = beta;
    }
    // Jacobi on R^T converges faster than on R: R^T = V' S U'^T
    matrix<Real> G = view(g, k, k, k), V = view(v, k, k, k);
    G.setZero();
    for (int j = 0; j < k; ++j) G.row(j).head(j + 1) = view(q, tall, k, tall).col(j).head(j + 1).transpose();
    if (!jacobi(G, V)) return 1;
    sort_columns(G, V, s);
    for (int j = 0; j < k; ++j) s[j] = std::ldexp(s[j], exponent);
    // A (or A^T) = Q R = Q V S G^T: the tall factor is Q V, the short one G.
    Real* out = wide ? a : u;
    matrix<Real> tall_factor = view(out, tall, k, tall);
    tall_factor.setZero();
    tall_factor.topRows(k) = V;
    for (int j = k - 1; j >= 0; --j)
        reflect_left(out + j, tall, tall - j, k, q + static_cast<size_t>(j) * static_cast<size_t>(tall) + j + 1,
                     tau[j]);
    if (wide) {
        view(vt, k, cols, k) = tall_factor.transpose();
        view(u, rows, k, rows) = G;
    } else
        view(vt, k, cols, k) = G.transpose();
    return 0;
}

// ---- eigenvalues of a general real matrix ------------------------------------------------------------------------------

template <class Real> size_t eigen_work(int n, bool with_vectors) {
    const auto size = static_cast<size_t>(n);
    return (with_vectors ? size * size : 0) + 3 * size;
}

namespace {

template <class Real> struct schur {
    int n;
    Real *t, *z; // quasi-triangular form and (or nullptr) the accumulated rotations
    Real& T(int i, int j) const { return t[static_cast<size_t>(j) * static_cast<size_t>(n) + static_cast<size_t>(i)]; }

    void to_hessenberg(Real* spare) const {
        for (int k = 0; k + 2 < n; ++k) {
            const int length = n - k - 1;
            Real* x = &T(k + 1, k);
            Real beta = 0;
            const Real tau = reflector(x, length, &beta);
            std::copy(x + 1, x + length, spare);
            reflect_left(&T(k + 1, k + 1), n, length, n - k - 1, spare, tau);
            reflect_right(&T(0, k + 1), n, n, length, spare, tau);
            if (z != nullptr)
                reflect_right(z + static_cast<size_t>(k + 1) * static_cast<size_t>(n), n, n, length, spare, tau);
            *x = beta;
            std::fill(x + 1, x + length, Real(0));
        }
    }

    bool small(int k) const { // is the subdiagonal entry (k, k-1) negligible?
        const Real scale = std::abs(T(k, k)) + std::abs(T(k - 1, k - 1));
        return std::abs(T(k, k - 1)) <= limit_of<Real>(2.2e-16) * (scale > 0 ? scale : nothing<Real>);
    }

    /// One Real-shift sweep on rows low..high.
    void sweep(int low, int high, Real sum, Real product) const {
        Real x = T(low, low) * T(low, low) + T(low, low + 1) * T(low + 1, low) - sum * T(low, low) + product;
        Real y = T(low + 1, low) * (T(low, low) + T(low + 1, low + 1) - sum);
        Real w = low + 2 <= high ? T(low + 1, low) * T(low + 2, low + 1) : 0;
        for (int k = low; k < high; ++k) {
            const int length = std::min(3, high - k + 1);
            Real v[3] = {x, y, w}, beta = 0;
            const Real tau = reflector(v, length, &beta);
            const int from = std::max(k - 1, 0);
            reflect_left(&T(k, from), n, length, n - from, v + 1, tau);
            reflect_right(&T(0, k), n, std::min(k + 4, high + 1), length, v + 1, tau);
            if (z != nullptr)
                reflect_right(z + static_cast<size_t>(k) * static_cast<size_t>(n), n, n, length, v + 1, tau);
            if (k > low) {
                T(k + 1, k - 1) = 0;
                if (length == 3) T(k + 2, k - 1) = 0;
            }
            x = T(k + 1, k);
            y = k + 2 <= high ? T(k + 2, k) : 0;
            w = k + 3 <= high ? T(k + 3, k) : 0;
        }
    }

    /// Split the 2 x 2 block at (k, k+1) when its eigenvalues are real.
    void split(int k) const {
        const Real p = (T(k, k) - T(k + 1, k + 1)) / 2, bc = T(k, k + 1) * T(k + 1, k), disc = p * p + bc;
        if (disc < 0) return;
        const Real root = p + std::copysign(std::sqrt(disc), p);
        const Real r = std::hypot(root, T(k + 1, k));
        if (!(r > 0)) return;
        const Eigen::JacobiRotation<Real> turn(root / r, T(k + 1, k) / r);
        matrix<Real> M = view(t, n, n, n);
        M.rightCols(n - k).applyOnTheLeft(k, k + 1, turn);
        M.topRows(k + 2).applyOnTheRight(k, k + 1, turn.transpose());
        if (z != nullptr) {
            matrix<Real> Z = view(z, n, n, n);
            Z.applyOnTheRight(k, k + 1, turn.transpose());
        }
        T(k + 1, k) = 0;
    }

    bool iterate() const {
        int high = n - 1, steps = 0;
        while (high > 0) {
            int low = high;
            while (low > 0 && !small(low)) --low;
            if (low > 0) T(low, low - 1) = 0;
            if (low == high) {
                --high;
                steps = 0;
                continue;
            }
            if (low == high - 1) {
                split(low);
                high -= 2;
                steps = 0;
                continue;
            }
            if (++steps > 60 * n) return false;
            Real sum = T(high, high) + T(high - 1, high - 1);
            Real product = T(high, high) * T(high - 1, high - 1) - T(high, high - 1) * T(high - 1, high);
            if (steps % 10 == 0) { // an exceptional shift breaks a cycle
                const Real s = std::abs(T(high, high - 1)) + std::abs(T(high - 1, high - 2));
                sum = Real(1.5) * s;
                product = s * s;
            }
            sweep(low, high, sum, product);
        }
        return true;
    }
};

/// (a + ib) / (c + id)
template <class Real> void divide(Real a, Real b, Real c, Real d, Real* re, Real* im) {
    const Real size = std::hypot(c, d), cc = c / size, dd = d / size;
    *re = (a * cc + b * dd) / size;
    *im = (b * cc - a * dd) / size;
}

/// Eigenvector of the quasi-triangular T for eigenvalue k (pair k, k+1 when im > 0), by back-substitution.
template <class Real> void back_substitute(const schur<Real>& s, int k, Real re, Real im, Real* x, Real* y) {
    const int n = s.n, top = im > 0 ? k + 1 : k;
    std::fill(x, x + n, Real(0));
    std::fill(y, y + n, Real(0));
    Real norm = nothing<Real>;
    for (int i = 0; i <= top; ++i) norm = std::max(norm, std::abs(s.T(i, i)));
    const Real tiny = limit_of<Real>(2.2e-16) * norm;
    int i = k - 1;
    if (im > 0) { // (T_kk - mu) x_k + T_k,k+1 x_(k+1) = 0
        x[k + 1] = 1;
        divide(-s.T(k, k + 1), Real(0), s.T(k, k) - re, -im, &x[k], &y[k]);
    } else
        x[k] = 1;
    auto right = [&](int row, int from, Real* a, Real* b) {
        *a = *b = 0;
        for (int j = from; j <= top; ++j) {
            *a -= s.T(row, j) * x[j];
            *b -= s.T(row, j) * y[j];
        }
    };
    while (i >= 0) {
        const bool pair = i > 0 && s.T(i, i - 1) != 0;
        Real a, b;
        right(i, i + 1, &a, &b);
        Real dr = s.T(i, i) - re, di = -im;
        if (!pair) {
            if (std::hypot(dr, di) < tiny) dr = tiny;
            divide(a, b, dr, di, &x[i], &y[i]);
            --i;
            continue;
        }
        Real a1, b1;
        right(i - 1, i + 1, &a1, &b1);
        // [T_(i-1,i-1) - mu, T_(i-1,i); T_(i,i-1), T_(i,i) - mu] [x_(i-1); x_i] = [r1; r]
        const Real er = s.T(i - 1, i - 1) - re, ei = -im, f = s.T(i - 1, i), g = s.T(i, i - 1);
        Real detr = er * dr - ei * di - f * g, deti = er * di + ei * dr;
        if (std::hypot(detr, deti) < tiny * norm) detr = tiny * norm;
        divide(a1 * dr - b1 * di - f * a, a1 * di + b1 * dr - f * b, detr, deti, &x[i - 1], &y[i - 1]);
        divide(er * a - ei * b - g * a1, er * b + ei * a - g * b1, detr, deti, &x[i], &y[i]);
        i -= 2;
    }
}

} // namespace

template <class Real>
int eigen(int n, Real* a, Real* re, Real* im, as_is<Real*> vectors, Real* work, as_is<wanted_eigenvalue<Real>> wanted) {
    Real *z = vectors != nullptr ? work : nullptr,
         *x = vectors != nullptr ? work + static_cast<size_t>(n) * static_cast<size_t>(n) : work, *y = x + n;
    if (z != nullptr) view(z, n, n, n).setIdentity();
    const schur<Real> s{n, a, z};
    s.to_hessenberg(x);
    if (!s.iterate()) return 1;
    for (int k = 0; k < n; ++k) {
        re[k] = s.T(k, k);
        im[k] = 0;
        if (k + 1 < n && s.T(k + 1, k) != 0) {
            const Real p = (s.T(k, k) + s.T(k + 1, k + 1)) / 2, d = (s.T(k, k) - s.T(k + 1, k + 1)) / 2;
            const Real root = std::sqrt(std::max(Real(0), -(d * d + s.T(k, k + 1) * s.T(k + 1, k))));
            re[k] = re[k + 1] = p;
            im[k] = root;
            im[k + 1] = -root;
            ++k;
        }
    }
    if (vectors == nullptr) return 0;
    for (int k = 0; k < n; ++k) {
        const bool pair = im[k] > 0;
        if (wanted != nullptr && !(pair && wanted(re[k], im[k]))) continue;
        back_substitute(s, k, re[k], im[k], x, y);
        Real* column = vectors + static_cast<size_t>(k) * static_cast<size_t>(n);
        multiply(false, false, n, 1, n, 1, z, n, x, n, 0, column, n);
        if (pair) multiply(false, false, n, 1, n, 1, z, n, y, n, 0, column + n, n);
        const Real size =
            std::sqrt(vector<Real>(column, n).squaredNorm() + (pair ? vector<Real>(column + n, n).squaredNorm() : 0));
        if (size > 0) {
            vector<Real>(column, n) /= size;
            if (pair) vector<Real>(column + n, n) /= size;
        }
        if (pair) ++k;
    }
    return 0;
}

template int cholesky(int, double*, int);
template void cholesky_solve(int, const double*, int, double*, int, int);
template double cholesky_condition(int, const double*, int, double, double*);
template void multiply(bool, bool, int, int, int, double, const double*, int, const double*, int, double, double*, int);
template size_t svd_work<okid_real_t>(int, int);
template int svd(int, int, okid_real_t*, okid_real_t*, okid_real_t*, okid_real_t*, okid_real_t*);
template size_t eigen_work<okid_real_t>(int, bool);
template int eigen(int, okid_real_t*, okid_real_t*, okid_real_t*, okid_real_t*, okid_real_t*,
                   wanted_eigenvalue<okid_real_t>);

// Where okid_real_t is float the first four exist for it too.
#define OKID_IS_float 1
#define OKID_JOIN(a, b) a##b
#define OKID_IS(type) OKID_JOIN(OKID_IS_, type)
#if OKID_IS(OKID_REAL)
template int cholesky(int, float*, int);
template void cholesky_solve(int, const float*, int, float*, int, int);
template float cholesky_condition(int, const float*, int, float, float*);
template void multiply(bool, bool, int, int, int, float, const float*, int, const float*, int, float, float*, int);
#endif

} // namespace okid::linalg

extern "C" const char* okid_backend(void) { return okid::linalg::name(); }
