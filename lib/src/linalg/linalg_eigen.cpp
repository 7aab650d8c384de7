// SPDX-License-Identifier: MIT
// PURPOSE    linear algebra without LAPACK and without a heap: Eigen's expressions and in-place kernels on caller's memory
// METHOD     right-looking blocked Cholesky; Householder QR and one-sided Jacobi SVD; Hessenberg reduction and shifted QR
//            on the real Schur form with back-substituted eigenvectors
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 4.2, 5.2, 7.5-7.6; one-sided Jacobi: Hestenes (1958)
// NUMERICS   backward stable; one-sided Jacobi gives small singular values to high relative accuracy
// WORKSPACE  as linalg.hpp states; products are lazy (coefficient-based), so that Eigen asks for no temporaries
#include "linalg.hpp"

#include <okid/types.h>

#include <Eigen/Core>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>

namespace okid::linalg {
namespace {

using std::size_t;
using stride = Eigen::OuterStride<>;
using matrix = Eigen::Map<Eigen::MatrixXd, 0, stride>;
using const_matrix = Eigen::Map<const Eigen::MatrixXd, 0, stride>;
using vector = Eigen::Map<Eigen::VectorXd>;
constexpr int block = 32;

matrix view(double* a, int rows, int cols, int ld) { return {a, rows, cols, stride(ld)}; }
const_matrix view(const double* a, int rows, int cols, int ld) { return {a, rows, cols, stride(ld)}; }

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
double reflector(double* x, int n, double* beta) {
    vector tail(x + 1, n - 1);
    const double alpha = x[0], rest = n > 1 ? tail.squaredNorm() : 0;
    if (!(rest > 0)) {
        *beta = alpha;
        return 0;
    }
    *beta = -std::copysign(std::sqrt(alpha * alpha + rest), alpha);
    tail /= alpha - *beta;
    return (*beta - alpha) / *beta;
}

/// A <- (I - tau v v^T) A, v = [1; tail].
void reflect_left(double* a, int lda, int rows, int cols, const double* tail, double tau) {
    if (tau == 0) return;
    Eigen::Map<const Eigen::VectorXd> v(tail, rows - 1);
    for (int j = 0; j < cols; ++j) {
        double* column = a + static_cast<size_t>(j) * static_cast<size_t>(lda);
        vector rest(column + 1, rows - 1);
        const double w = tau * (column[0] + v.dot(rest));
        column[0] -= w;
        rest.noalias() -= w * v;
    }
}

/// A <- A (I - tau v v^T).
void reflect_right(double* a, int lda, int rows, int cols, const double* tail, double tau) {
    if (tau == 0) return;
    for (int i = 0; i < rows; ++i) {
        double w = a[i];
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

int cholesky(int n, double* a, int lda) {
    for (int k = 0; k < n; k += block) {
        const int width = std::min(block, n - k), below = n - k - width;
        matrix d = view(a + static_cast<size_t>(k) * static_cast<size_t>(lda) + k, width + below, width, lda);
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

void cholesky_solve(int n, const double* l, int ldl, double* b, int ldb, int count) {
    const const_matrix L = view(l, n, n, ldl);
    for (int c = 0; c < count; ++c) {
        vector x(b + static_cast<size_t>(c) * static_cast<size_t>(ldb), n);
        for (int j = 0; j < n; ++j) {
            x[j] /= L(j, j);
            x.tail(n - j - 1) -= x[j] * L.col(j).tail(n - j - 1);
        }
        for (int j = n - 1; j >= 0; --j) x[j] = (x[j] - L.col(j).tail(n - j - 1).dot(x.tail(n - j - 1))) / L(j, j);
    }
}

double cholesky_condition(int n, const double* l, int ldl, double norm1, double* work) {
    // Hager's 1-norm estimate of the inverse (symmetric, so one solve a step).
    vector x(work, n), y(work + n, n);
    x.setConstant(1.0 / n);
    double estimate = 0;
    for (int step = 0; step < 5; ++step) {
        y = x;
        cholesky_solve(n, l, ldl, y.data(), n, 1);
        const double size = y.lpNorm<1>();
        if (step > 0 && size <= estimate) break;
        estimate = size;
        for (int i = 0; i < n; ++i) y[i] = y[i] >= 0 ? 1 : -1;
        cholesky_solve(n, l, ldl, y.data(), n, 1);
        int best = 0;
        y.cwiseAbs().maxCoeff(&best);
        if (std::abs(y[best]) <= y.dot(x)) break;
        x.setZero();
        x[best] = 1;
    }
    return norm1 * estimate;
}

void multiply(bool transpose_a, bool transpose_b, int rows, int cols, int inner, double alpha, const double* a, int lda,
              const double* b, int ldb, double beta, double* c, int ldc) {
    matrix C = view(c, rows, cols, ldc);
    if (beta == 0)
        C.setZero();
    else if (beta != 1)
        C *= beta;
    const const_matrix A = view(a, transpose_a ? inner : rows, transpose_a ? rows : inner, lda);
    const const_matrix B = view(b, transpose_b ? cols : inner, transpose_b ? inner : cols, ldb);
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

size_t svd_work(int rows, int cols) {
    const auto tall = static_cast<size_t>(std::max(rows, cols)), k = static_cast<size_t>(std::min(rows, cols));
    return tall * k + 2 * k * k + 2 * k;
}

namespace {

/// One-sided Jacobi of g (k x k): columns become orthogonal, v collects the rotations.
bool jacobi(matrix g, matrix v) {
    const int k = static_cast<int>(g.cols());
    v.setIdentity();
    for (int sweep = 0; sweep < 60; ++sweep) {
        bool still = false;
        for (int p = 0; p + 1 < k; ++p)
            for (int q = p + 1; q < k; ++q) {
                const double pp = g.col(p).squaredNorm(), qq = g.col(q).squaredNorm(), pq = g.col(p).dot(g.col(q));
                if (std::abs(pq) <= 1e-15 * std::sqrt(pp * qq) || pq == 0) continue;
                still = true;
                const double tau = (qq - pp) / (2 * pq);
                const double t = std::copysign(1 / (std::abs(tau) + std::sqrt(1 + tau * tau)), tau);
                const double c = 1 / std::sqrt(1 + t * t);
                const Eigen::JacobiRotation<double> rotation(c, c * t);
                g.applyOnTheRight(p, q, rotation);
                v.applyOnTheRight(p, q, rotation);
            }
        if (!still) return true;
    }
    return false;
}

/// Order columns of g and v by the length of g's columns, which become the singular values; g's columns turn to unit.
void sort_columns(matrix g, matrix v, double* s) {
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

int svd(int rows, int cols, double* a, double* u, double* s, double* vt, double* work) {
    const bool wide = cols > rows;
    const int tall = std::max(rows, cols), k = std::min(rows, cols);
    double *q = work, *g = q + static_cast<size_t>(tall) * static_cast<size_t>(k),
           *v = g + static_cast<size_t>(k) * static_cast<size_t>(k);
    double* tau = v + static_cast<size_t>(k) * static_cast<size_t>(k);
    if (wide)
        view(q, tall, k, tall) = view(a, rows, cols, rows).transpose();
    else
        view(q, tall, k, tall) = view(a, rows, cols, rows);
    for (int j = 0; j < k; ++j) {
        double* x = q + static_cast<size_t>(j) * static_cast<size_t>(tall) + j;
        double beta = 0;
        tau[j] = reflector(x, tall - j, &beta);
        reflect_left(x + tall, tall, tall - j, k - j - 1, x + 1, tau[j]);
        *x = beta;
    }
    // Jacobi on R^T converges faster than on R: R^T = V' S U'^T
    matrix G = view(g, k, k, k), V = view(v, k, k, k);
    G.setZero();
    for (int j = 0; j < k; ++j)
        for (int i = 0; i <= j; ++i) G(j, i) = q[static_cast<size_t>(j) * static_cast<size_t>(tall) + i];
    if (!jacobi(G, V)) return 1;
    sort_columns(G, V, s);
    // A (or A^T) = Q R = Q V S G^T: the tall factor is Q V, the short one G.
    double* out = wide ? a : u;
    matrix tall_factor = view(out, tall, k, tall);
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

size_t eigen_work(int n) {
    const auto size = static_cast<size_t>(n);
    return size * size + 3 * size;
}

namespace {

struct schur {
    int n;
    double *t, *z; // quasi-triangular form and (or nullptr) the accumulated rotations
    double& T(int i, int j) const {
        return t[static_cast<size_t>(j) * static_cast<size_t>(n) + static_cast<size_t>(i)];
    }

    void to_hessenberg(double* spare) const {
        for (int k = 0; k + 2 < n; ++k) {
            const int length = n - k - 1;
            double* x = &T(k + 1, k);
            double beta = 0;
            const double tau = reflector(x, length, &beta);
            std::copy(x + 1, x + length, spare);
            reflect_left(&T(k + 1, k + 1), n, length, n - k - 1, spare, tau);
            reflect_right(&T(0, k + 1), n, n, length, spare, tau);
            if (z != nullptr)
                reflect_right(z + static_cast<size_t>(k + 1) * static_cast<size_t>(n), n, n, length, spare, tau);
            *x = beta;
            std::fill(x + 1, x + length, 0.0);
        }
    }

    bool small(int k) const { // is the subdiagonal entry (k, k-1) negligible?
        const double scale = std::abs(T(k, k)) + std::abs(T(k - 1, k - 1));
        return std::abs(T(k, k - 1)) <= 2.2e-16 * (scale > 0 ? scale : 1e-300);
    }

    /// One double-shift sweep on rows low..high.
    void sweep(int low, int high, double sum, double product) const {
        double x = T(low, low) * T(low, low) + T(low, low + 1) * T(low + 1, low) - sum * T(low, low) + product;
        double y = T(low + 1, low) * (T(low, low) + T(low + 1, low + 1) - sum);
        double w = low + 2 <= high ? T(low + 1, low) * T(low + 2, low + 1) : 0;
        for (int k = low; k < high; ++k) {
            const int length = std::min(3, high - k + 1);
            double v[3] = {x, y, w}, beta = 0;
            const double tau = reflector(v, length, &beta);
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
        const double p = (T(k, k) - T(k + 1, k + 1)) / 2, bc = T(k, k + 1) * T(k + 1, k), disc = p * p + bc;
        if (disc < 0) return;
        const double root = p + std::copysign(std::sqrt(disc), p);
        const double r = std::hypot(root, T(k + 1, k));
        if (!(r > 0)) return;
        const Eigen::JacobiRotation<double> turn(root / r, T(k + 1, k) / r);
        matrix M = view(t, n, n, n);
        M.rightCols(n - k).applyOnTheLeft(k, k + 1, turn);
        M.topRows(k + 2).applyOnTheRight(k, k + 1, turn.transpose());
        if (z != nullptr) {
            matrix Z = view(z, n, n, n);
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
            double sum = T(high, high) + T(high - 1, high - 1);
            double product = T(high, high) * T(high - 1, high - 1) - T(high, high - 1) * T(high - 1, high);
            if (steps % 10 == 0) { // an exceptional shift breaks a cycle
                const double s = std::abs(T(high, high - 1)) + std::abs(T(high - 1, high - 2));
                sum = 1.5 * s;
                product = s * s;
            }
            sweep(low, high, sum, product);
        }
        return true;
    }
};

/// (a + ib) / (c + id)
void divide(double a, double b, double c, double d, double* re, double* im) {
    const double size = std::hypot(c, d), cc = c / size, dd = d / size;
    *re = (a * cc + b * dd) / size;
    *im = (b * cc - a * dd) / size;
}

/// Eigenvector of the quasi-triangular T for eigenvalue k (pair k, k+1 when im > 0), by back-substitution.
void back_substitute(const schur& s, int k, double re, double im, double* x, double* y) {
    const int n = s.n, top = im > 0 ? k + 1 : k;
    std::fill(x, x + n, 0.0);
    std::fill(y, y + n, 0.0);
    double norm = 1e-300;
    for (int i = 0; i <= top; ++i) norm = std::max(norm, std::abs(s.T(i, i)));
    const double tiny = 2.2e-16 * norm;
    int i = k - 1;
    if (im > 0) { // (T_kk - mu) x_k + T_k,k+1 x_(k+1) = 0
        x[k + 1] = 1;
        divide(-s.T(k, k + 1), 0, s.T(k, k) - re, -im, &x[k], &y[k]);
    } else
        x[k] = 1;
    auto right = [&](int row, int from, double* a, double* b) {
        *a = *b = 0;
        for (int j = from; j <= top; ++j) {
            *a -= s.T(row, j) * x[j];
            *b -= s.T(row, j) * y[j];
        }
    };
    while (i >= 0) {
        const bool pair = i > 0 && s.T(i, i - 1) != 0;
        double a, b;
        right(i, i + 1, &a, &b);
        double dr = s.T(i, i) - re, di = -im;
        if (!pair) {
            if (std::hypot(dr, di) < tiny) dr = tiny;
            divide(a, b, dr, di, &x[i], &y[i]);
            --i;
            continue;
        }
        double a1, b1;
        right(i - 1, i + 1, &a1, &b1);
        // [T_(i-1,i-1) - mu, T_(i-1,i); T_(i,i-1), T_(i,i) - mu] [x_(i-1); x_i] = [r1; r]
        const double er = s.T(i - 1, i - 1) - re, ei = -im, f = s.T(i - 1, i), g = s.T(i, i - 1);
        double detr = er * dr - ei * di - f * g, deti = er * di + ei * dr;
        if (std::hypot(detr, deti) < tiny * norm) detr = tiny * norm;
        divide(a1 * dr - b1 * di - f * a, a1 * di + b1 * dr - f * b, detr, deti, &x[i - 1], &y[i - 1]);
        divide(er * a - ei * b - g * a1, er * b + ei * a - g * b1, detr, deti, &x[i], &y[i]);
        i -= 2;
    }
}

} // namespace

int eigen(int n, double* a, double* re, double* im, double* vectors, double* work) {
    double *z = vectors != nullptr ? work : nullptr, *x = work + static_cast<size_t>(n) * static_cast<size_t>(n),
           *y = x + n;
    if (z != nullptr) view(z, n, n, n).setIdentity();
    const schur s{n, a, z};
    s.to_hessenberg(x);
    if (!s.iterate()) return 1;
    for (int k = 0; k < n; ++k) {
        re[k] = s.T(k, k);
        im[k] = 0;
        if (k + 1 < n && s.T(k + 1, k) != 0) {
            const double p = (s.T(k, k) + s.T(k + 1, k + 1)) / 2, d = (s.T(k, k) - s.T(k + 1, k + 1)) / 2;
            const double root = std::sqrt(std::max(0.0, -(d * d + s.T(k, k + 1) * s.T(k + 1, k))));
            re[k] = re[k + 1] = p;
            im[k] = root;
            im[k + 1] = -root;
            ++k;
        }
    }
    if (vectors == nullptr) return 0;
    for (int k = 0; k < n; ++k) {
        back_substitute(s, k, re[k], im[k], x, y);
        const bool pair = im[k] > 0;
        double* column = vectors + static_cast<size_t>(k) * static_cast<size_t>(n);
        multiply(false, false, n, 1, n, 1, z, n, x, n, 0, column, n);
        if (pair) multiply(false, false, n, 1, n, 1, z, n, y, n, 0, column + n, n);
        const double size =
            std::sqrt(vector(column, n).squaredNorm() + (pair ? vector(column + n, n).squaredNorm() : 0));
        if (size > 0) {
            vector(column, n) /= size;
            if (pair) vector(column + n, n) /= size;
        }
        if (pair) ++k;
    }
    return 0;
}

} // namespace okid::linalg

extern "C" const char* okid_backend(void) { return okid::linalg::name(); }
