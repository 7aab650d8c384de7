// SPDX-License-Identifier: MIT
// PURPOSE    eigenvectors of an upper Hessenberg matrix, one complex eigenvalue at a time, where few are wanted
// METHOD     elimination with partial pivoting of H - mu I, which is all but singular, and back substitution from a start
//            that is no eigenvector of anything in particular; a result that has not grown is started again elsewhere
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 7.6; Ipsen, Computing an eigenvector with inverse iteration (1997)
// NUMERICS   mu is an eigenvalue to rounding of the norm; eigenvalues closer than the caller's bound need another method
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace okid::linalg {

template <class Real> struct complex_number {
    Real re, im;
};

/// a / b without overflow on the way: Smith (1962).
template <class Real> complex_number<Real> quotient(complex_number<Real> a, complex_number<Real> b) {
    if (std::abs(b.re) >= std::abs(b.im)) {
        const Real r = b.im / b.re, d = b.re + b.im * r;
        return {(a.re + a.im * r) / d, (a.im - a.re * r) / d};
    }
    const Real r = b.re / b.im, d = b.re * r + b.im;
    return {(a.re * r + a.im) / d, (a.im * r - a.re) / d};
}

/// A sum is kept in so many parts, which a compiler keeps side by side.
constexpr int sum_parts = 8;

/// All parts together, in pairs.
template <class Real> Real total(Real (&part)[sum_parts]) {
    for (int width = sum_parts / 2; width > 0; width /= 2)
        for (int k = 0; k < width; ++k) part[k] += part[k + width];
    return part[0];
}

/// Sum of the products of two complex arrays.
template <class Real>
complex_number<Real> product_of(int count, const Real* a, const Real* b, const Real* x, const Real* y) {
    Real re[sum_parts] = {}, im[sum_parts] = {};
    int j = 0;
    for (; j + sum_parts <= count; j += sum_parts)
        for (int k = 0; k < sum_parts; ++k) {
            re[k] += a[j + k] * x[j + k] - b[j + k] * y[j + k];
            im[k] += a[j + k] * y[j + k] + b[j + k] * x[j + k];
        }
    for (; j < count; ++j) {
        re[0] += a[j] * x[j] - b[j] * y[j];
        im[0] += a[j] * y[j] + b[j] * x[j];
    }
    return {total(re), total(im)};
}

template <class Real> class inverse_iteration {
  public:
    static std::size_t work(int n) { return 3 * static_cast<std::size_t>(n) * static_cast<std::size_t>(n); }

    /// @param h  upper Hessenberg n x n, column-major; what is below the subdiagonal is not read
    inverse_iteration(int n, const Real* h, Real* work)
        : n_(n), rows_(work), re_(work + square()), im_(re_ + square()) {
        for (int i = 0; i < n; ++i) {
            Real sum = 0;
            for (int j = std::max(0, i - 1); j < n; ++j) {
                row(rows_, i)[j] =
                    h[static_cast<std::size_t>(j) * static_cast<std::size_t>(n) + static_cast<std::size_t>(i)];
                sum += std::abs(row(rows_, i)[j]);
            }
            norm_ = std::max(norm_, sum);
        }
        least_ = std::max(norm_ * std::numeric_limits<Real>::epsilon(), std::numeric_limits<Real>::min());
    }

    Real norm() const { return norm_; }

    /// @return false: no start has grown, (x, y) is nothing
    bool find(Real mu_re, Real mu_im, Real* x, Real* y) const {
        eliminate(mu_re, mu_im);
        constexpr int starts = 4;
        const Real root = std::sqrt(static_cast<Real>(n_));
        for (int attempt = 0; attempt < starts; ++attempt) {
            std::fill(x, x + n_, attempt == 0 ? least_ : least_ / (root + 1));
            std::fill(y, y + n_, Real(0));
            if (attempt > 0) {
                x[0] = least_;
                if (attempt <= n_) x[n_ - attempt] -= least_ * root;
            }
            const Real scale = substitute(x, y);
            Real sum = 0;
            for (int i = 0; i < n_; ++i) sum += std::abs(x[i]) + std::abs(y[i]);
            if (std::isfinite(sum) && sum * root * 10 >= scale) return true;
        }
        return false;
    }

  private:
    int n_;
    Real *rows_, *re_, *im_; // H by rows; the triangle of H - mu I by rows
    Real norm_ = 0, least_ = 0;

    std::size_t square() const { return static_cast<std::size_t>(n_) * static_cast<std::size_t>(n_); }
    Real* row(Real* a, int i) const { return a + static_cast<std::size_t>(i) * static_cast<std::size_t>(n_); }

    void eliminate(Real mu_re, Real mu_im) const {
        std::copy(rows_, rows_ + n_, re_);
        std::fill(im_, im_ + n_, Real(0));
        re_[0] -= mu_re;
        im_[0] -= mu_im;
        for (int i = 0; i + 1 < n_; ++i) {
            Real *a = row(re_, i), *b = row(im_, i), *c = row(re_, i + 1), *d = row(im_, i + 1);
            const Real *next = row(rows_, i + 1), below = next[i];
            if (std::abs(a[i]) + std::abs(b[i]) < std::abs(below)) { // the rows change places
                const Real p = a[i] / below, q = b[i] / below;
                a[i] = below;
                b[i] = 0;
                for (int j = i + 1; j < n_; ++j) {
                    c[j] = a[j] - p * next[j];
                    d[j] = b[j] - q * next[j];
                    a[j] = next[j];
                    b[j] = 0;
                }
                a[i + 1] -= mu_re;
                b[i + 1] -= mu_im;
                c[i + 1] += p * mu_re - q * mu_im;
                d[i + 1] += p * mu_im + q * mu_re;
            } else {
                if (a[i] == 0 && b[i] == 0) a[i] = least_;
                const complex_number<Real> m = quotient<Real>({below, 0}, {a[i], b[i]});
                for (int j = i + 1; j < n_; ++j) {
                    c[j] = next[j] - m.re * a[j] + m.im * b[j];
                    d[j] = -m.re * b[j] - m.im * a[j];
                }
                c[i + 1] -= mu_re;
                d[i + 1] -= mu_im;
            }
        }
    }

    /// (x, y) <- scale x triangle^-1 (x, y). @return scale
    Real substitute(Real* x, Real* y) const {
        const Real large = std::sqrt(std::numeric_limits<Real>::max()) / static_cast<Real>(n_);
        Real scale = 1;
        for (int i = n_ - 1; i >= 0; --i) {
            const Real *a = row(re_, i), *b = row(im_, i);
            const complex_number<Real> known = product_of(n_ - 1 - i, a + i + 1, b + i + 1, x + i + 1, y + i + 1);
            complex_number<Real> pivot{a[i], b[i]};
            if (std::abs(pivot.re) + std::abs(pivot.im) < least_) pivot = {least_, 0};
            const complex_number<Real> found = quotient<Real>({x[i] - known.re, y[i] - known.im}, pivot);
            x[i] = found.re;
            y[i] = found.im;
            const Real size = std::abs(found.re) + std::abs(found.im);
            if (size < large) continue;
            for (int j = 0; j < n_; ++j) {
                x[j] /= size;
                y[j] /= size;
            }
            scale /= size;
        }
        return scale;
    }
};

/// x <- Q x for both columns of x (n x 2), Q of the reduction to Hessenberg form as LAPACK leaves it below the subdiagonal.
template <class Real> void turn_back(int n, const Real* reduced, const Real* tau, Real* x) {
    for (int k = n - 3; k >= 0; --k) {
        const Real* v = reduced + static_cast<std::size_t>(k) * static_cast<std::size_t>(n);
        for (Real* column = x; column <= x + n; column += n) {
            Real sum[sum_parts] = {column[k + 1]};
            int i = k + 2;
            for (; i + sum_parts <= n; i += sum_parts)
                for (int l = 0; l < sum_parts; ++l) sum[l] += v[i + l] * column[i + l];
            for (; i < n; ++i) sum[0] += v[i] * column[i];
            const Real w = tau[k] * total(sum);
            column[k + 1] -= w;
            for (int j = k + 2; j < n; ++j) column[j] -= w * v[j];
        }
    }
}

} // namespace okid::linalg
