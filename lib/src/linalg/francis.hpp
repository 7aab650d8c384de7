// SPDX-License-Identifier: MIT
// PURPOSE    eigenvalues alone of an upper Hessenberg matrix of some dozen rows, as identification asks for at every order
// METHOD     implicit double shifts on the part that has not parted yet; LAPACK's dlahqr calls a dozen functions for each
//            reflector of three rows, which at this size is half of its time
// REFERENCE  Golub, Van Loan, Matrix Computations (2013) 7.5; a subdiagonal entry counts as none by Ahues, Tisseur (1997)
// NUMERICS   backward stable; for matrices that were balanced
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace okid::linalg {

template <class Real> class francis {
  public:
    /// @param h  n x n, column-major, destroyed; what is below the subdiagonal is not read
    francis(int n, Real* h) : n_(n), h_(h) {}

    /// @return false: no convergence
    bool find(Real* re, Real* im) const {
        for (int j = 0; j + 2 < n_; ++j) // as far as a step reaches
            for (int i = j + 2; i <= std::min(j + 3, n_ - 1); ++i) H(i, j) = 0;
        for (int high = n_ - 1, steps = 0; high >= 0;) {
            int low = high;
            while (low > 0 && !is_none(low)) --low;
            if (low >= high - 1) {
                if (low == high)
                    re[high] = H(high, high), im[high] = 0;
                else
                    solve_last(low, re + low, im + low);
                high = low - 1;
                steps = 0;
                continue;
            }
            if (++steps > most_steps) return false;
            sweep(low, high, shifts_of(low, high, steps));
        }
        return true;
    }

  private:
    static constexpr int most_steps = 300, steps_to_exception = 10;

    /// Two shifts: a + ib and c - ib.
    struct shift_pair {
        Real a, c, b;
    };

    int n_;
    Real* h_;

    Real& H(int i, int j) const {
        return h_[static_cast<std::size_t>(j) * static_cast<std::size_t>(n_) + static_cast<std::size_t>(i)];
    }

    /// May the entry (k, k - 1) be taken for zero?
    bool is_none(int k) const {
        constexpr Real unit = std::numeric_limits<Real>::epsilon(), least = std::numeric_limits<Real>::min() / unit;
        const Real below = std::abs(H(k, k - 1));
        if (below <= least) return true;
        Real size = std::abs(H(k - 1, k - 1)) + std::abs(H(k, k));
        if (size == 0) {
            if (k > 1) size += std::abs(H(k - 1, k - 2));
            if (k + 1 < n_) size += std::abs(H(k + 1, k));
        }
        if (below > unit * size) return false;
        const Real above = std::abs(H(k - 1, k)), apart = std::abs(H(k - 1, k - 1) - H(k, k)), last = std::abs(H(k, k));
        const Real ab = std::max(below, above), ba = std::min(below, above), aa = std::max(last, apart),
                   bb = std::min(last, apart), sum = aa + ab;
        return ba * (ab / sum) <= std::max(least, unit * (bb * (aa / sum)));
    }

    /// Eigenvalues of the 2 x 2 block at (k, k), a pair with the positive imaginary part first.
    void solve_last(int k, Real* re, Real* im) const {
        const Real a = H(k, k), b = H(k, k + 1), c = H(k + 1, k), d = H(k + 1, k + 1), p = (a - d) / 2;
        const Real scale = std::max(std::abs(p), std::sqrt(std::abs(b)) * std::sqrt(std::abs(c)));
        const Real ratio = scale > 0 ? p / scale : 0, inner = scale > 0 ? ratio * ratio + b / scale * (c / scale) : 0;
        if (inner < 0) {
            re[0] = re[1] = d + p;
            im[0] = scale * std::sqrt(-inner);
            im[1] = -im[0];
            return;
        }
        const Real far = p + std::copysign(scale * std::sqrt(inner), p);
        re[0] = d + far;
        re[1] = far != 0 ? d - b / far * c : d;
        im[0] = im[1] = 0;
    }

    shift_pair shifts_of(int low, int high, int steps) const {
        if (steps % (2 * steps_to_exception) == steps_to_exception) { // out of a cycle
            const Real s = std::abs(H(low + 1, low)) + std::abs(H(low + 2, low + 1)), a = Real(0.75) * s + H(low, low);
            return {a, a, std::sqrt(Real(0.4375)) * s};
        }
        if (steps % (2 * steps_to_exception) == 0) {
            const Real s = std::abs(H(high, high - 1)) + std::abs(H(high - 1, high - 2)),
                       a = Real(0.75) * s + H(high, high);
            return {a, a, std::sqrt(Real(0.4375)) * s};
        }
        Real re[2], im[2];
        solve_last(high - 1, re, im);
        if (im[0] != 0) return {re[0], re[1], im[0]};
        const Real last = H(high, high), near = std::abs(re[0] - last) < std::abs(re[1] - last) ? re[0] : re[1];
        return {near, near, 0};
    }

    /// One double step on rows and columns low to high.
    void sweep(int low, int high, shift_pair shifts) const {
        Real v[3];
        int first = high - 2; // where two small subdiagonal entries follow each other the rest may be left as it is
        for (;; --first) {
            const Real a = H(first, first), p = a - shifts.a, q = a - shifts.c;
            v[0] = p * q + shifts.b * shifts.b + H(first, first + 1) * H(first + 1, first);
            v[1] = H(first + 1, first) * (p + (H(first + 1, first + 1) - shifts.c));
            v[2] = H(first + 1, first) * H(first + 2, first + 1);
            const Real scale = std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
            if (scale > 0)
                for (Real& x : v) x /= scale;
            if (first == low) break;
            const Real beside = std::abs(H(first, first - 1)) * (std::abs(v[1]) + std::abs(v[2]));
            const Real size = std::abs(H(first - 1, first - 1)) + std::abs(a) + std::abs(H(first + 1, first + 1));
            if (beside <= std::numeric_limits<Real>::epsilon() * std::abs(v[0]) * size) break;
        }
        for (int k = first; k < high; ++k) {
            const bool three = k + 2 <= high;
            if (k > first) {
                v[0] = H(k, k - 1);
                v[1] = H(k + 1, k - 1);
                v[2] = three ? H(k + 2, k - 1) : 0;
            }
            const Real rest = v[1] * v[1] + (three ? v[2] * v[2] : 0);
            Real tau = 0, p = 0, q = 0, beta = v[0];
            if (rest > 0) {
                beta = -std::copysign(std::sqrt(v[0] * v[0] + rest), v[0]);
                tau = (beta - v[0]) / beta;
                p = v[1] / (v[0] - beta);
                q = three ? v[2] / (v[0] - beta) : 0;
            }
            if (k > first) {
                H(k, k - 1) = beta;
                H(k + 1, k - 1) = 0;
                if (three) H(k + 2, k - 1) = 0;
            } else if (first > low) {
                H(k, k - 1) *= 1 - tau; // the entries below it are as good as none
            }
            if (tau == 0) continue;
            if (three)
                turn_three(k, low, high, tau, p, q);
            else
                turn_two(k, low, high, tau, p);
        }
    }

    void turn_three(int k, int low, int high, Real tau, Real p, Real q) const {
        const Real tp = tau * p, tq = tau * q;
        for (int j = k; j <= high; ++j) {
            Real* x = &H(k, j);
            const Real sum = x[0] + p * x[1] + q * x[2];
            x[0] -= sum * tau;
            x[1] -= sum * tp;
            x[2] -= sum * tq;
        }
        Real* __restrict a = &H(0, k), * __restrict b = &H(0, k + 1), * __restrict c = &H(0, k + 2);
        const int end = std::min(k + 3, high);
        for (int i = low; i <= end; ++i) {
            const Real sum = a[i] + p * b[i] + q * c[i];
            a[i] -= sum * tau;
            b[i] -= sum * tp;
            c[i] -= sum * tq;
        }
    }

    void turn_two(int k, int low, int high, Real tau, Real p) const {
        const Real tp = tau * p;
        for (int j = k; j <= high; ++j) {
            Real* x = &H(k, j);
            const Real sum = x[0] + p * x[1];
            x[0] -= sum * tau;
            x[1] -= sum * tp;
        }
        Real* __restrict a = &H(0, k), * __restrict b = &H(0, k + 1);
        for (int i = low; i <= high; ++i) {
            const Real sum = a[i] + p * b[i];
            a[i] -= sum * tau;
            b[i] -= sum * tp;
        }
    }
};

} // namespace okid::linalg
