// SPDX-License-Identifier: MIT
// PURPOSE    what the change test keeps of a baseline: column space, complement, and the directions of its frequencies
// METHOD     eigenvectors of H P^-1 H'; those that the past explains beyond what noise gives are the space; its shift
//            invariance has the modes; a frequency's direction is the generalized least-squares weight of d lambda among
//            everything that a change of that mode (pole and shape) does to the complement
// REFERENCE  Basseville, Abdelghani, Benveniste (2000), sensitivities; paper eq. 84-86, shift invariance
// NUMERICS   sums are squared once more: singular values below 1e-8 of the largest are noise
// WORKSPACE  change.cpp; an eigendecomposition of i n_y, then per mode 8 i n_y (2 n_y)^2 flop
#include "change.hpp"

#include "identify/triangular.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

namespace okid {
namespace {

using complex = std::complex<double>;
using linalg::multiply;
using std::size_t;

constexpr double most_damping = 0.2;
constexpr double ridge = 1e-10;

/// scale <- 1 / rms of each channel over the rows of the past.
okid_status_t find_scale(okid_change& s) {
    for (int c = 0; c < s.m; ++c) {
        double sum = 0;
        const int at = s.n_f + s.h + c;
        for (int b = 0; b < s.added; ++b) sum += s.sums[area(b, s.w) * static_cast<size_t>(s.w) + area(at, s.w + 1)];
        if (!(sum > 0) || !std::isfinite(sum)) return c < s.config.n_u ? OKID_ERR_INPUT : OKID_ERR_OUTPUT;
        s.scale[c] = std::sqrt(s.rows / sum);
    }
    return OKID_OK;
}

/// States: directions of which the past explains more than noise alone would. Too many do no harm.
int count_states(okid_change& s) {
    if (s.config.order > 0) return s.config.order;
    const double edge = std::sqrt(static_cast<double>(s.k)) + std::sqrt(static_cast<double>(s.h));
    int states = 0;
    for (int j = 0; j < s.most_order; ++j) {
        const double* u = s.vectors + area(j, s.h);
        multiply(false, false, s.h, 1, s.h, 1, s.future, s.h, u, s.h, 0, s.half, s.h);
        double all = 0;
        for (int r = 0; r < s.h; ++r) all += u[r] * s.half[r];
        if (s.values[j] > all * edge * edge / s.rows) states = j + 1;
    }
    return std::min(s.most_order, (states + 1) / 2 * 2);
}

/// own, outside, and the factor of the covariance of what the past does not explain outside.
okid_status_t split(okid_change& s) {
    const int h = s.h, k = s.k;
    for (int c = 0; c < h; ++c)
        for (int r = 0; r < k; ++r)
            s.projected[area(c, k) + static_cast<size_t>(r)] = s.cross[area(r, h) + static_cast<size_t>(c)];
    linalg::cholesky_solve(k, s.past, k, s.projected, k, h);
    multiply(false, false, h, h, k, 1, s.cross, h, s.projected, k, 0, s.explained, h);
    std::copy_n(s.explained, area(h, h), s.noise);
    if (linalg::symmetric(h, s.noise, h, s.values, s.vectors, s.spare) != 0) return OKID_ERR_NUMERIC;
    s.order = count_states(s);
    if (s.order < 2) return OKID_ERR_NO_MODES;
    const int n = s.order, out = h - n;
    std::copy_n(s.vectors, area(h, n), s.own);
    std::copy_n(s.vectors + area(n, h), area(h, out), s.outside);
    for (size_t j = 0; j < area(h, h); ++j) s.future[j] -= s.explained[j];
    multiply(false, false, h, out, h, 1, s.future, h, s.outside, h, 0, s.explained, h);
    multiply(true, false, out, out, h, 1, s.outside, h, s.explained, h, 0, s.noise, out);
    double mean = 0;
    for (int j = 0; j < out; ++j) mean += s.noise[area(j, out + 1)] / out;
    for (int j = 0; j < out; ++j) s.noise[area(j, out + 1)] += ridge * mean;
    return linalg::cholesky(out, s.noise, out) == 0 ? OKID_OK : OKID_ERR_NUMERIC;
}

/// Poles and states of the modes: U_(2..i) = U_(1..i-1) A.
okid_status_t find_poles(okid_change& s) {
    const int n = s.order, h = s.h, n_y = s.config.n_y, rows = h - n_y;
    multiply(true, false, n, n, rows, 1, s.own, h, s.own, h, 0, s.core, n);
    multiply(true, false, n, n, rows, 1, s.own, h, s.own + n_y, h, 0, s.residual, n);
    for (int j = 0; j < n; ++j) s.core[area(j, n + 1)] += 1e-12;
    if (linalg::cholesky(n, s.core, n) != 0) return OKID_ERR_NUMERIC;
    linalg::cholesky_solve(n, s.core, n, s.residual, n, n);
    for (size_t j = 0; j < area(n, n); ++j) s.transition[j] = static_cast<okid_real_t>(s.residual[j]);
    return linalg::eigen(n, s.transition, s.re, s.im, s.eigenvectors, s.work) == 0 ? OKID_OK : OKID_ERR_NUMERIC;
}

/// A complex column of the Jacobian: what powers times a unit vector (channel < 0: the shape) leave in the complement.
void put_column(const okid_change& s, int column, int columns, const complex* powers, int channel) {
    const int out = s.h - s.order, n_y = s.config.n_y;
    double* real = s.jacobian + area(column, 2 * out); // by the real part of the unknown, then by its imaginary part
    double* imaginary = s.jacobian + area(columns + column, 2 * out);
    for (int r = 0; r < out; ++r) {
        const double* look = s.outside + area(r, s.h);
        complex sum = 0;
        for (int j = 0; j < s.config.rows; ++j) {
            complex seen = 0;
            if (channel >= 0)
                seen = look[j * n_y + channel];
            else
                for (int c = 0; c < n_y; ++c) seen += look[j * n_y + c] * s.shape[c];
            sum += powers[j] * seen;
        }
        real[r] = imaginary[out + r] = sum.real();
        real[out + r] = sum.imag();
        imaginary[r] = -sum.imag();
    }
}

/// Weights of the two halves of the complement for the relative change of |lambda|'s angle: the frequency.
okid_status_t weigh(okid_change& s, complex lambda, int columns, const change_direction& to) {
    const int out = s.h - s.order, q = 2 * columns;
    std::copy_n(s.jacobian, area(2 * out, q), s.whitened);
    for (int c = 0; c < 2 * q; ++c) linalg::cholesky_solve(out, s.noise, out, s.whitened + area(c, out), out, 1);
    multiply(true, false, q, q, 2 * out, 1, s.jacobian, 2 * out, s.whitened, 2 * out, 0, s.normal, q);
    double mean = 0;
    for (int j = 0; j < q; ++j) mean = std::max(mean, s.normal[area(j, q + 1)]);
    for (int j = 0; j < q; ++j) s.normal[area(j, q + 1)] += ridge * mean;
    if (linalg::cholesky(q, s.normal, q) != 0) return OKID_ERR_NUMERIC;
    const complex wanted = complex(0, -1) / (lambda * std::arg(lambda)); // df/f = Re(wanted d lambda)
    std::fill_n(s.target, q, 0.0);
    s.target[0] = wanted.real();
    s.target[columns] = -wanted.imag();
    linalg::cholesky_solve(q, s.normal, q, s.target, q, 1);
    multiply(false, false, out, 1, q, 1, s.whitened, 2 * out, s.target, q, 0, to.left_re, out);
    multiply(false, false, out, 1, q, 1, s.whitened + out, 2 * out, s.target, q, 0, to.left_im, out);
    return OKID_OK;
}

/// The direction of eigenvalue k, whose pair follows it.
okid_status_t find_direction(okid_change& s, int k, complex lambda, const change_direction& to) {
    const int n = s.order, n_y = s.config.n_y;
    const okid_real_t* vector = s.eigenvectors + area(k, n);
    for (int j = 0; j < n; ++j) {
        to.right_re[j] = static_cast<double>(vector[j]);
        to.right_im[j] = static_cast<double>(vector[n + j]);
    }
    for (int c = 0; c < n_y; ++c) {
        s.shape[c] = 0;
        for (int j = 0; j < n; ++j)
            s.shape[c] += s.own[area(j, s.h) + static_cast<size_t>(c)] * complex(to.right_re[j], to.right_im[j]);
    }
    complex power = 1, before = 0;
    for (int j = 0; j < s.config.rows; ++j, before = power, power *= lambda) {
        s.powers[j] = power;
        s.derivative[j] = static_cast<double>(j) * before;
    }
    const auto largest = static_cast<int>(
        std::max_element(s.shape, s.shape + n_y, [](complex a, complex b) { return std::norm(a) < std::norm(b); }) -
        s.shape);
    int column = 0; // the largest entry of the shape is held: its scale means nothing
    put_column(s, column++, n_y, s.derivative, -1);
    for (int c = 0; c < n_y; ++c)
        if (c != largest) put_column(s, column++, n_y, s.powers, c);
    return weigh(s, lambda, n_y, to);
}

} // namespace

okid_status_t change_space(okid_change& s) {
    okid_status_t status = find_scale(s);
    if (status == OKID_OK) status = change_reduce(s);
    if (status == OKID_OK) status = split(s);
    if (status == OKID_OK) status = find_poles(s);
    if (status < 0) return status;
    s.modes = 0;
    for (int k = 0; k < s.order; ++k) {
        const complex lambda(static_cast<double>(s.re[k]), static_cast<double>(s.im[k]));
        if (!(lambda.imag() > 0)) continue;
        const complex rate = std::log(lambda);
        const double damping = -rate.real() / std::abs(rate);
        if (!(damping > 0) || damping > most_damping) continue;
        status = find_direction(s, k, lambda, s.direction[s.modes]);
        if (status < 0) return status;
        s.mode[s.modes++] = {std::abs(rate) * s.config.fs_hz / (2 * 3.14159265358979323846), damping, 0, 0};
    }
    return s.modes > 0 ? OKID_OK : OKID_ERR_NO_MODES;
}

} // namespace okid
