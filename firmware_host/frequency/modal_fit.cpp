// SPDX-License-Identifier: MIT
// PURPOSE  residues of modes in measured frequency responses, and the likeliest poles under white noise
// METHOD   H(s) = sum_k r_k / (s - l_k) + conjugate + three powers of s for what lies below and above the band (LSFD), one
//          QR for all responses of one kind of sensor; the poles by Gauss-Newton with the residues eliminated (variable
//          projection, Kaufman's form), responses weighted by what the fit leaves of them
// REFERENCE Golub, Pereyra (1973); Kaufman (1975); Heylen, Lammens, Sas, Modal Analysis Theory and Testing
// NUMERICS frequencies over the highest line, columns at unit length; the covariance of the poles is widened by the
//          correlation of what is left from line to line, as windows with overlap make it
#include "modal_fit.hpp"

#include <algorithm>
#include <cmath>
#include <okid/mkr.h>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_halvings = 5;
constexpr double farthest_step = 0.5; // of the decay rate
constexpr double least_gain = 1e-7;   // of the cost
constexpr double farthest = 0.02;     // in frequency, from the start
constexpr Index correlated_lines = 6;

/// Real and imaginary parts below each other.
MatrixXd parts(const MatrixXcd& from) {
    MatrixXd out(2 * from.rows(), from.cols());
    out << from.real(), from.imag();
    return out;
}

/// Responses of one kind of sensor: they share their basis.
struct kind {
    std::vector<Index> columns;
    int lowest = 0; // power of s
    MatrixXd y;     // parts of the responses
    MatrixXd Q, left, coefficients;
    VectorXd unit_variance; // of each coefficient
};

struct problem {
    Eigen::VectorXcd s; // j w over the highest w
    double w_high = 0;
    std::vector<kind> kinds;
};

problem make_problem(const response_set& set, const std::vector<int>& sensing) {
    problem out;
    out.w_high = 2 * M_PI * set.frequency_hz.back();
    out.s.resize(set.lines());
    for (Index l = 0; l < set.lines(); ++l)
        out.s[l] = complex(0, set.frequency_hz[static_cast<std::size_t>(l)] / set.frequency_hz.back());
    for (const auto& [what, lowest] : {std::pair{static_cast<int>(OKID_SENSE_DISPLACEMENT), -2},
                                       std::pair{static_cast<int>(OKID_SENSE_VELOCITY), -1},
                                       std::pair{static_cast<int>(OKID_SENSE_ACCELERATION), 0}}) {
        kind one;
        one.lowest = lowest;
        for (Index c = 0; c < set.H.cols(); ++c)
            if (sensing[static_cast<std::size_t>(c % set.n_y())] == what) one.columns.push_back(c);
        if (one.columns.empty()) continue;
        MatrixXcd own(set.lines(), static_cast<Index>(one.columns.size()));
        for (std::size_t k = 0; k < one.columns.size(); ++k) own.col(static_cast<Index>(k)) = set.H.col(one.columns[k]);
        one.y = parts(own);
        out.kinds.push_back(std::move(one));
    }
    return out;
}

/// 1 / (s - l)^power and its partner, the columns of Re and Im of a coefficient.
void put_pole(const Eigen::VectorXcd& s, complex pole, int power, MatrixXcd& to, Index column) {
    for (Index l = 0; l < s.size(); ++l) {
        complex a = 1.0 / (s[l] - pole), b = 1.0 / (s[l] - std::conj(pole));
        if (power == 2) a *= a, b *= b;
        to(l, column) = a + b;
        to(l, column + 1) = complex(0, 1) * (a - b);
    }
}

/// Least squares of all responses for these poles. @return the weighted sum of squares
double fit_linear(const std::vector<complex>& poles, const VectorXd& weight, problem& all) {
    const auto n = static_cast<Index>(poles.size());
    double cost = 0;
    for (kind& one : all.kinds) {
        MatrixXcd basis(all.s.size(), 2 * n + 3);
        for (Index k = 0; k < n; ++k) put_pole(all.s, poles[static_cast<std::size_t>(k)], 1, basis, 2 * k);
        for (int p = 0; p < 3; ++p)
            for (Index l = 0; l < all.s.size(); ++l) basis(l, 2 * n + p) = std::pow(all.s[l], one.lowest + p);
        MatrixXd A = parts(basis);
        const VectorXd size = A.colwise().norm();
        A.array().rowwise() /= size.transpose().array();
        const Eigen::HouseholderQR<MatrixXd> qr(A);
        one.Q = qr.householderQ() * MatrixXd::Identity(A.rows(), A.cols());
        const MatrixXd along = one.Q.transpose() * one.y;
        one.left = one.y - one.Q * along;
        const auto R = qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>();
        one.coefficients = size.cwiseInverse().asDiagonal() * MatrixXd(R.solve(along));
        const MatrixXd inverse = R.solve(MatrixXd::Identity(A.cols(), A.cols()));
        one.unit_variance = inverse.rowwise().squaredNorm().cwiseQuotient(size.cwiseAbs2());
        for (std::size_t k = 0; k < one.columns.size(); ++k)
            cost += weight[one.columns[k]] * one.left.col(static_cast<Index>(k)).squaredNorm();
    }
    return cost;
}

/// One over the variance of what is left of each response; those that are nearly exact do not rule the others.
VectorXd weights(const problem& all, Index responses) {
    VectorXd variance(responses);
    double level = 0;
    for (const kind& one : all.kinds)
        for (std::size_t k = 0; k < one.columns.size(); ++k) {
            const auto at = static_cast<Index>(k);
            const double degrees = std::max<double>(1, static_cast<double>(one.y.rows() - one.Q.cols()));
            variance[one.columns[k]] = one.left.col(at).squaredNorm() / degrees;
            level += one.y.col(at).squaredNorm() / static_cast<double>(one.y.rows() * responses);
        }
    return variance.cwiseMax(1e-20 * level + 1e-300).cwiseInverse();
}

/// Normal equations of the poles' real and imaginary parts, the residues eliminated.
void normal_equations(const std::vector<complex>& poles, const VectorXd& weight, const problem& all, MatrixXd& N,
                      VectorXd& b) {
    const auto n = static_cast<Index>(poles.size());
    N.setZero(2 * n, 2 * n);
    b.setZero(2 * n);
    for (const kind& one : all.kinds) {
        MatrixXcd slopes(all.s.size(), 2 * n);
        for (Index k = 0; k < n; ++k) put_pole(all.s, poles[static_cast<std::size_t>(k)], 2, slopes, 2 * k);
        MatrixXd G = parts(slopes);
        G -= one.Q * (one.Q.transpose() * G);
        const MatrixXd gram = G.transpose() * G, along = G.transpose() * one.left;
        for (std::size_t c = 0; c < one.columns.size(); ++c) {
            const double w = weight[one.columns[c]];
            MatrixXd J(2 * n, 2 * n); // of this response, in the basis of the slopes
            J.setZero();
            for (Index k = 0; k < n; ++k) {
                const double re = one.coefficients(2 * k, static_cast<Index>(c)),
                             im = one.coefficients(2 * k + 1, static_cast<Index>(c));
                J.block<2, 2>(2 * k, 2 * k) << re, -im, im, re;
            }
            N += w * J.transpose() * gram * J;
            b += w * J.transpose() * along.col(static_cast<Index>(c));
        }
    }
}

/// A step of the poles, no farther than half their decay rates; one that would run away from its start stays.
std::vector<complex> moved(const std::vector<complex>& start, const std::vector<complex>& poles, const VectorXd& step,
                           double share) {
    std::vector<complex> out;
    for (std::size_t k = 0; k < poles.size(); ++k) {
        const auto at = static_cast<Index>(2 * k);
        complex d(step[at], step[at + 1]);
        const double most = farthest_step * std::abs(poles[k].real());
        if (std::abs(d) > most) d *= most / std::abs(d);
        const complex next = poles[k] + share * d;
        const double reach = std::max(farthest * std::abs(start[k]), -start[k].real());
        const bool held = next.real() < 0 && std::abs(next.imag() - start[k].imag()) < reach;
        out.push_back(held ? next : poles[k]);
    }
    return out;
}

/// How much neighbouring lines repeat each other: 1 for white noise.
double repetition(const problem& all) {
    VectorXd sums = VectorXd::Zero(correlated_lines + 1);
    const Index lines = all.s.size();
    for (const kind& one : all.kinds)
        for (Index c = 0; c < one.left.cols(); ++c) {
            const double power = one.left.col(c).squaredNorm();
            for (Index lag = 0; lag <= correlated_lines && power > 0; ++lag)
                for (const Index half : {Index{0}, lines})
                    sums[lag] += one.left.col(c)
                                     .segment(half, lines - lag)
                                     .dot(one.left.col(c).segment(half + lag, lines - lag)) /
                                 power;
        }
    double out = 1;
    for (Index lag = 1; lag <= correlated_lines && sums[lag] > 0; ++lag) out += 2 * sums[lag] / sums[0];
    return out;
}

modal_fit result_of(const std::vector<complex>& poles, const problem& all, const response_set& set,
                    const VectorXd& weight) {
    modal_fit out;
    const auto n = static_cast<Index>(poles.size());
    for (const complex& pole : poles) out.poles.push_back(pole * all.w_high);
    out.residues.resize(n, set.H.cols());
    out.unit_variance.resize(n, set.H.cols());
    out.left.resize(set.lines(), set.H.cols());
    out.variance = weight.cwiseInverse();
    for (const kind& one : all.kinds)
        for (std::size_t c = 0; c < one.columns.size(); ++c) {
            const auto at = static_cast<Index>(c);
            out.left.col(one.columns[c]).real() = one.left.col(at).head(set.lines());
            out.left.col(one.columns[c]).imag() = one.left.col(at).tail(set.lines());
            for (Index k = 0; k < n; ++k) {
                out.residues(k, one.columns[c]) =
                    all.w_high * complex(one.coefficients(2 * k, at), one.coefficients(2 * k + 1, at));
                out.unit_variance(k, one.columns[c]) = all.w_high * all.w_high * one.unit_variance[2 * k];
            }
        }
    return out;
}

} // namespace

modal_fit fit_modes(const response_set& set, const std::vector<int>& sensing, std::vector<complex> poles, int steps) {
    problem all = make_problem(set, sensing);
    for (complex& pole : poles) pole /= all.w_high;
    const std::vector<complex> start = poles;
    VectorXd weight = VectorXd::Ones(set.H.cols()), b;
    MatrixXd N;
    (void)fit_linear(poles, weight, all);
    for (int step = 0; step < steps; ++step) {
        weight = weights(all, set.H.cols());
        const double cost = fit_linear(poles, weight, all);
        normal_equations(poles, weight, all, N, b);
        const VectorXd along = N.ldlt().solve(b);
        double gained = 0, share = 1;
        for (int k = 0; k < most_halvings && !(gained > 0); ++k, share /= 2) {
            if (!along.allFinite()) break;
            const std::vector<complex> next = moved(start, poles, along, share);
            gained = cost - fit_linear(next, weight, all);
            if (gained > 0) poles = next;
        }
        if (!(gained > least_gain * cost)) break;
    }
    (void)fit_linear(poles, weight, all);
    weight = weights(all, set.H.cols());
    normal_equations(poles, weight, all, N, b);
    modal_fit out = result_of(poles, all, set, weight);
    const Eigen::LDLT<MatrixXd> factor(N);
    if (factor.info() == Eigen::Success && factor.isPositive())
        out.covariance =
            all.w_high * all.w_high * repetition(all) * MatrixXd(factor.solve(MatrixXd::Identity(N.rows(), N.cols())));
    return out;
}

} // namespace okid_host
