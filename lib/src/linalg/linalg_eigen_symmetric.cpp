// SPDX-License-Identifier: MIT
// PURPOSE    eigenvalues and leading eigenvectors of a symmetric matrix, without LAPACK and without a heap
// METHOD     Householder reduction to tridiagonal form, implicit QR steps with Wilkinson's shift, rotations accumulated,
//            reflectors applied to the wanted vectors
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 8.3
// NUMERICS   backward stable: every eigenvalue has the absolute error of the largest
// WORKSPACE  n^2 + 3 n numbers; 4/3 n^3 flop for the form, some 5 n^3 for the rotations
#include "linalg.hpp"

#include <Eigen/Core>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>

namespace okid::linalg {
namespace {

using std::size_t;
using matrix = Eigen::Map<Eigen::MatrixXd>;
using vector = Eigen::Map<Eigen::VectorXd>;

/// Lower triangle of a -> tridiagonal form (d, e); below its subdiagonal the reflectors stay, tau beside them.
/// spare: n numbers
void reduce(matrix a, double* d, double* e, double* tau, double* spare) {
    const int n = static_cast<int>(a.rows());
    for (int k = 0; k + 1 < n; ++k) {
        const int length = n - k - 1;
        auto v = a.col(k).tail(length);
        const double head = v[0], rest = v.tail(length - 1).squaredNorm();
        d[k] = a(k, k);
        e[k] = head;
        tau[k] = 0;
        if (!(rest > 0)) continue;
        e[k] = -std::copysign(std::sqrt(head * head + rest), head);
        tau[k] = (e[k] - head) / e[k];
        v.tail(length - 1) /= head - e[k];
        v[0] = 1;
        auto below = a.bottomRightCorner(length, length);
        vector p(spare, length); // tau A v, from the lower triangle alone
        p.setZero();
        for (int j = 0; j < length; ++j) {
            const int under = length - j - 1;
            p[j] += v[j] * below(j, j) + below.col(j).tail(under).dot(v.tail(under));
            p.tail(under) += v[j] * below.col(j).tail(under);
        }
        p *= tau[k];
        p -= (tau[k] / 2 * p.dot(v)) * v;
        for (int j = 0; j < length; ++j)
            below.col(j).tail(length - j) -= v[j] * p.tail(length - j) + p[j] * v.tail(length - j);
    }
    d[n - 1] = a(n - 1, n - 1);
}

/// One implicit step on rows low..high of the tridiagonal form.
void step(double* d, double* e, int low, int high, matrix z) {
    const double half = (d[high - 1] - d[high]) / 2, last = e[high - 1];
    const double shift = d[high] - last * (last / (half + std::copysign(std::hypot(half, last), half)));
    double x = d[low] - shift, bulge = e[low];
    for (int k = low; k < high; ++k) {
        const double size = std::hypot(x, bulge), c = size > 0 ? x / size : 1, s = size > 0 ? bulge / size : 0;
        if (k > low) e[k - 1] = size;
        const double above = d[k], under = d[k + 1], beside = e[k];
        d[k] = c * c * above + 2 * c * s * beside + s * s * under;
        d[k + 1] = s * s * above - 2 * c * s * beside + c * c * under;
        e[k] = c * s * (under - above) + (c * c - s * s) * beside;
        x = e[k];
        if (k + 1 < high) {
            bulge = s * e[k + 1];
            e[k + 1] *= c;
        }
        z.applyOnTheRight(k, k + 1, Eigen::JacobiRotation<double>(c, -s));
    }
}

/// d <- eigenvalues, z <- eigenvectors of the tridiagonal form. @return false: no convergence
bool iterate(int n, double* d, double* e, matrix z) {
    z.setIdentity();
    int left = 30 * n;
    const auto negligible = [&](int k) {
        return std::abs(e[k]) <= std::numeric_limits<double>::epsilon() * (std::abs(d[k]) + std::abs(d[k + 1]));
    };
    for (int high = n - 1; high > 0;) {
        if (negligible(high - 1)) {
            --high;
            continue;
        }
        int low = high - 1;
        while (low > 0 && !negligible(low - 1)) --low;
        if (left-- == 0) return false;
        step(d, e, low, high, z);
    }
    return true;
}

} // namespace

size_t symmetric_work(int n, int) { return static_cast<size_t>(n) * (static_cast<size_t>(n) + 3); }

int symmetric(int n, double* a, int k, double* values, double* vectors, double* work) {
    matrix A(a, n, n), Z(work, n, n), V(vectors, n, k);
    double *e = work + static_cast<size_t>(n) * static_cast<size_t>(n), *tau = e + n, *spare = tau + n;
    reduce(A, values, e, tau, spare);
    if (!iterate(n, values, e, Z)) return 1;
    for (int j = 0; j < n; ++j) {
        const int best = static_cast<int>(std::max_element(values + j, values + n) - values);
        std::swap(values[j], values[best]);
        if (best != j) Z.col(j).swap(Z.col(best));
    }
    V = Z.leftCols(k);
    for (int r = n - 2; r >= 0; --r) {
        const int length = n - r - 1;
        const auto v = A.col(r).tail(length);
        for (int j = 0; tau[r] != 0 && j < k; ++j) V.col(j).tail(length) -= (tau[r] * v.dot(V.col(j).tail(length))) * v;
    }
    return 0;
}

} // namespace okid::linalg
