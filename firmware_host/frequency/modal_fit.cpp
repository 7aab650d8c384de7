// SPDX-License-Identifier: MIT
// PURPOSE  residues of modes in measured frequency responses, and the likeliest poles under the noise that is left
// METHOD   H(s) = sum_k r_k / (s - l_k) + conjugate + five powers of s for what lies below and above the band, of motions of any
//          kind (LSFD), one QR for all responses; the poles by Gauss-Newton with the residues eliminated (variable projection,
//          Kaufman's form). A Hann window widens what it averages: its part is known and fitted along. Responses are weighted by what the fit leaves of them, lines by what it leaves around them
//          Places of a roving hammer or sensor meet a structure that is not quite the same: each moves the pole, and where they do
//          by more than their noise the pole is the mean over places of that scatter, with its variance (random effects). The noise
//          is what is left near the resonance along its residues, so that errors common to all outputs count
// REFERENCE Golub, Pereyra (1973); Kaufman (1975); Heylen, Lammens, Sas, Modal Analysis Theory and Testing; Paule, Mandel (1982),
//          means of measurements that differ
// NUMERICS frequencies over the highest line, columns at unit length; the covariance is widened by the correlation of what is
//          left from line to line, as windows with overlap make it
#include "modal_fit.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_halvings = 5;
constexpr double farthest_step = 0.5;                   // of the decay rate
constexpr double least_gain = 1e-7;                     // of the cost
constexpr double farthest = 0.02;                       // in frequency, from the start
constexpr Index correlated_lines = 64, local_lags = 2;  // lines; an exponential window makes many alike
constexpr std::size_t full_lines = 6;                   // that count as if they stood in one place
constexpr double chance_level = 2;                      // deviations of a correlation that is none
constexpr Index residual_powers = 5, lowest_power = -2; // of s
constexpr Index noise_reach = 10;                       // lines to either side over which their noise is taken
constexpr double quietest_line = 1e-3;                  // of the mean noise
constexpr double least_of_a_place = 0.2; // of an even share of what is known of a pole: below lies a node of its shape
constexpr int rounds_of_places = 8;      // of weights and scatter between places, from noise alone

/// Real and imaginary parts below each other.
MatrixXd parts(const MatrixXcd& from) {
    MatrixXd out(2 * from.rows(), from.cols());
    out << from.real(), from.imag();
    return out;
}

struct problem {
    Eigen::VectorXcd s; // j w over the highest w
    double w_high = 0;
    double window = 0; // length of a Hann window, in 1 / w_high; 0: none
    double sample = 0; // step of sampled decays, in 1 / w_high; 0: not from samples
    MatrixXcd H;
    VectorXd root; // one over the noise of each line, rms 1
    // Weighted, parts below each other:
    MatrixXd y, Q, left, coefficients;
    MatrixXd inverse;      // coefficients = inverse Q^T y
    MatrixXd slopes, gram; // along the poles, the residues eliminated
};

problem make_problem(const response_set& set, double window_s, double sample_s) {
    problem out;
    out.w_high = 2 * M_PI * set.frequency_hz.back();
    out.window = window_s * out.w_high;
    out.sample = sample_s * out.w_high;
    out.s.resize(set.lines());
    for (Index l = 0; l < set.lines(); ++l)
        out.s[l] = complex(0, set.frequency_hz[static_cast<std::size_t>(l)] / set.frequency_hz.back());
    out.H = set.H;
    out.root = VectorXd::Ones(set.lines());
    out.y = parts(out.H);
    return out;
}

/// Integral of t^k exp(-a t), 0 .. T. @param e  exp(-a T)
complex moment(complex a, int k, double T, complex e) {
    const complex x = a * T;
    if (k == 0) return (1.0 - e) / a;
    if (k == 1) return (1.0 - (1.0 + x) * e) / (a * a);
    return (2.0 - (2.0 + 2.0 * x + x * x) * e) / (a * a * a);
}

/// 1 / z^power; under a window what averages of random vibration make of it: the transform of t^(power-1) exp(-z t) times the
/// correlation of the Hann window with itself, (1 - t/T) (2 + cos(2 pi t/T)) / 3 + sin(2 pi t/T) / (2 pi).
complex through_window(complex z, int power, double T) {
    if (T == 0) return power == 1 ? 1.0 / z : 1.0 / (z * z);
    const complex turn(0, 2 * M_PI / T), e = std::exp(-z * T); // the same a whole turn farther
    const auto fading = [&](complex a) { return moment(a, power - 1, T, e) - moment(a, power, T, e) / T; };
    return 2.0 / 3.0 * fading(z) + (fading(z + turn) + fading(z - turn)) / 6.0 +
           (moment(z - turn, power - 1, T, e) - moment(z + turn, power - 1, T, e)) / complex(0, 4 * M_PI);
}

/// Transform of t^(power-1) exp(-z t): of its samples, the first halved, where the responses come from sampled decays. Near
/// the Nyquist frequency the two differ.
complex transform(const problem& all, complex z, int power) {
    if (all.sample == 0) return through_window(z, power, all.window);
    const complex half = all.sample / 2 * z;
    return power == 1 ? all.sample / 2 / std::tanh(half) : std::pow(all.sample / 2 / std::sinh(half), 2);
}

/// 1 / (s - l)^power and its partner, the columns of Re and Im of a coefficient.
void put_pole(const problem& all, complex pole, int power, MatrixXcd& to, Index column) {
    for (Index l = 0; l < all.s.size(); ++l) {
        const complex a = transform(all, all.s[l] - pole, power), b = transform(all, all.s[l] - std::conj(pole), power);
        to(l, column) = a + b;
        to(l, column + 1) = complex(0, 1) * (a - b);
    }
}

/// Least squares of all responses for these poles. @return the weighted sum of squares
double fit_linear(const std::vector<complex>& poles, const VectorXd& weight, problem& all) {
    const auto n = static_cast<Index>(poles.size());
    MatrixXcd basis(all.s.size(), 2 * n + residual_powers);
    for (Index k = 0; k < n; ++k) put_pole(all, poles[static_cast<std::size_t>(k)], 1, basis, 2 * k);
    for (Index p = 0; p < residual_powers; ++p)
        for (Index l = 0; l < all.s.size(); ++l)
            basis(l, 2 * n + p) = std::pow(all.s[l], static_cast<int>(lowest_power + p));
    MatrixXd A = parts(all.root.asDiagonal() * basis);
    const VectorXd size = A.colwise().norm();
    A.array().rowwise() /= size.transpose().array();
    const Eigen::HouseholderQR<MatrixXd> qr(A);
    all.Q = qr.householderQ() * MatrixXd::Identity(A.rows(), A.cols());
    const MatrixXd along = all.Q.transpose() * all.y;
    all.left = all.y - all.Q * along;
    const auto R = qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>();
    all.coefficients = size.cwiseInverse().asDiagonal() * MatrixXd(R.solve(along));
    all.inverse = size.cwiseInverse().asDiagonal() * MatrixXd(R.solve(MatrixXd::Identity(A.cols(), A.cols())));
    return all.left.colwise().squaredNorm().dot(weight);
}

/// One over the variance of what is left of each response; those that are nearly exact do not rule the others.
VectorXd weights(const problem& all) {
    const double degrees = std::max<double>(1, static_cast<double>(all.y.rows() - all.Q.cols()));
    const double level = all.y.squaredNorm() / static_cast<double>(all.y.size());
    const VectorXd variance = all.left.colwise().squaredNorm().transpose() / degrees;
    return variance.cwiseMax(1e-20 * level + 1e-300).cwiseInverse();
}

/// Share of each line that the fit cannot leave.
VectorXd taken(const MatrixXd& Q) {
    const Index lines = Q.rows() / 2;
    return (Q.topRows(lines).rowwise().squaredNorm() + Q.bottomRows(lines).rowwise().squaredNorm()) / 2;
}

/// Lines by what the fit leaves around them: a sensor below its range, or a force without power, is noise of these lines.
void weigh_lines(const VectorXd& weight, problem& all) {
    const Index lines = all.s.size(), reach = std::max(noise_reach, lines / 50);
    const VectorXd left = (all.left.topRows(lines).cwiseAbs2() + all.left.bottomRows(lines).cwiseAbs2()) * weight;
    const VectorXd power = left.cwiseQuotient(all.root.cwiseAbs2()), free = (1 - taken(all.Q).array()).matrix();
    VectorXd noise(lines);
    for (Index l = 0; l < lines; ++l) {
        const Index first = std::max<Index>(0, l - reach), count = std::min(lines, l + reach + 1) - first;
        noise[l] = power.segment(first, count).sum() / std::max(free.segment(first, count).sum(), 1e-3);
    }
    all.root = (noise / noise.mean()).cwiseMax(quietest_line).cwiseSqrt().cwiseInverse();
    all.root /= std::sqrt(all.root.squaredNorm() / static_cast<double>(lines));
    all.y = parts(all.root.asDiagonal() * all.H);
}

/// Of a response: how its residue of a pole turns that pole's slopes.
Eigen::Matrix2d turn_of(const problem& all, Index k, Index c) {
    const double re = all.coefficients(2 * k, c), im = all.coefficients(2 * k + 1, c);
    return (Eigen::Matrix2d() << re, -im, im, re).finished();
}

/// Normal equations of the poles' real and imaginary parts, the residues eliminated. @return their right-hand side, a
/// column a response
MatrixXd normal_equations(const std::vector<complex>& poles, const VectorXd& weight, problem& all, MatrixXd& N) {
    const auto n = static_cast<Index>(poles.size());
    MatrixXcd slopes(all.s.size(), 2 * n);
    for (Index k = 0; k < n; ++k) put_pole(all, poles[static_cast<std::size_t>(k)], 2, slopes, 2 * k);
    all.slopes = parts(all.root.asDiagonal() * slopes);
    all.slopes -= all.Q * (all.Q.transpose() * all.slopes);
    all.gram = all.slopes.transpose() * all.slopes;
    MatrixXd b = all.slopes.transpose() * all.left * weight.asDiagonal();
    N.setZero(2 * n, 2 * n);
    for (Index c = 0; c < weight.size(); ++c) {
        MatrixXd J = MatrixXd::Zero(2 * n, 2 * n);
        for (Index k = 0; k < n; ++k) {
            J.block<2, 2>(2 * k, 2 * k) = turn_of(all, k, c);
            b.block<2, 1>(2 * k, c) = (turn_of(all, k, c).transpose() * b.block<2, 1>(2 * k, c)).eval();
        }
        N += weight[c] * J.transpose() * all.gram * J;
    }
    return b;
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

/// How much the lines of what is left repeat those that are so many lower, from 0 on; as far as it is no chance.
std::vector<complex> repetition(const problem& all) {
    const Index lines = all.s.size();
    const VectorXd power = all.left.colwise().squaredNorm().cwiseMax(1e-300).cwiseInverse();
    const auto sum = [&](Index lag) {
        const auto of = [&](Index first, Index second) {
            return all.left.middleRows(first, lines - lag)
                .cwiseProduct(all.left.middleRows(second + lag, lines - lag))
                .colwise()
                .sum()
                .dot(power);
        };
        return complex(of(0, 0) + of(lines, lines), of(0, lines) - of(lines, 0));
    };
    const double whole = sum(0).real(), chance = chance_level / std::sqrt(static_cast<double>(all.left.size()));
    std::vector<complex> out{1};
    for (Index lag = 1; lag <= std::min(correlated_lines, lines / 4); ++lag) {
        out.push_back(sum(lag) / whole);
        if (!(std::abs(out.back()) > chance)) break;
    }
    return out;
}

/// By how much noise that repeats itself moves a sum over the lines more than white noise. @param row  what of each line, parts
/// below each other
double repeated_along(const VectorXd& row, const std::vector<complex>& repeats) {
    const Index lines = row.size() / 2;
    Eigen::VectorXcd along(lines);
    along.real() = row.head(lines), along.imag() = row.tail(lines);
    double out = 1, few = 1;
    for (std::size_t m = 1; m < repeats.size(); ++m) {
        const auto lag = static_cast<Index>(m);
        const complex own = along.head(lines - lag).dot(along.tail(lines - lag));
        out += 2 * (own * std::conj(repeats[m])).real() / row.squaredNorm();
        if (m <= full_lines)
            few += 2 * std::max(0.0, repeats[m].real()); // at the mode alone: elsewhere the row may cancel it
    }
    return std::max(out, few);
}

/// What lines leave along the residues of a pole, over what white noise of the mean level would; each with its share.
struct line_noise {
    double found = 0, expected = 0;
    Eigen::Array<double, local_lags + 1, 1> products = Eigen::Array<double, local_lags + 1, 1>::Zero();

    double more() const { return std::max(1.0, found / std::max(expected, 1e-300)); }
    double alike() const { return 2 * (products / std::max(products[0], 1e-300)).max(0.0).sum() - 1; }
};

/// How much more than white noise of its mean level moves a pole, and its residues: what is left near it, along its residues, and
/// how much lines repeat each other; or what is left of the lines that rule them. @param repeats  of all lines
std::pair<double, double> local_noise(const problem& all, complex pole, const VectorXd& weight, Index k,
                                      const std::vector<complex>& repeats) {
    const Index lines = all.s.size();
    Eigen::VectorXcd along(weight.size());
    for (Index c = 0; c < weight.size(); ++c)
        along[c] = weight[c] * complex(all.coefficients(2 * k, c), -all.coefficients(2 * k + 1, c));
    Eigen::VectorXcd left(lines);
    left.real() = all.left.topRows(lines) * along.real() - all.left.bottomRows(lines) * along.imag();
    left.imag() = all.left.topRows(lines) * along.imag() + all.left.bottomRows(lines) * along.real();
    const MatrixXd own = all.slopes.middleCols(2 * k, 2);
    const MatrixXd inverse = all.gram.block<2, 2>(2 * k, 2 * k).inverse();
    const VectorXd self = (own * inverse).cwiseProduct(own).rowwise().sum();
    const VectorXd free = (1 - taken(all.Q).array() - (self.head(lines) + self.tail(lines)).array() / 2).cwiseMax(0.0);
    const double power = 2 * along.cwiseAbs2().cwiseQuotient(weight).sum();
    const auto noise = [&](const auto& share) {
        line_noise out;
        for (Index l = 0; l < lines; ++l) {
            out.found += share(l) * std::norm(left[l]);
            out.expected += share(l) * free[l] * power;
            for (Index lag = 0; lag <= std::min(local_lags, lines - 1 - l); ++lag)
                out.products[lag] += share(l) * (left[l] * std::conj(left[l + lag])).real();
        }
        return out;
    };
    const line_noise near = noise([&](Index l) { return std::norm(all.root[l] / (all.s[l] - pole)); });
    const auto more = [&](const VectorXd& row) {
        const line_noise ruling = noise([&](Index l) { return row[l] * row[l] + row[l + lines] * row[l + lines]; });
        return std::max(std::max(repeated_along(row, repeats), near.alike()) * near.more(), ruling.more());
    };
    return {more(own * inverse.col(0)), more(all.Q * all.inverse.row(2 * k).transpose())};
}

/// One part of a pole as the mean over places that may differ by more than their noise. @param moves  by which each moves the mean
/// weighted by `share`, which add up to 0; @param variance  by noise alone; out: of the mean over the places. @return what that
/// mean adds
double meet(const VectorXd& moves, const VectorXd& share, double& variance) {
    std::vector<Index> known;
    for (Index g = 0; g < share.size(); ++g)
        if (share[g] * static_cast<double>(share.size()) > least_of_a_place) known.push_back(g);
    if (known.size() < 2) return 0;
    double between = 0, mean = 0, weight = 0;
    for (int round = 0; round < rounds_of_places; ++round) {
        double squares = 0, noise = 0, spread = 0;
        mean = weight = 0;
        const auto own = [&](Index g) { return 1 / (between + variance / share[g]); };
        for (const Index g : known) weight += own(g), mean += own(g) * moves[g] / share[g];
        mean /= weight;
        for (const Index g : known) {
            squares += own(g) * own(g) / weight;
            noise += own(g) * (1 - own(g) / weight) * variance / share[g];
            spread += own(g) * std::pow(moves[g] / share[g] - mean, 2);
        }
        between = std::max(0.0, (spread - noise) / std::max(weight - squares, 1e-3 * weight));
    }
    const double free = static_cast<double>(known.size()) - 1; // few places know little of their own scatter (Student)
    variance += std::max(0.0, 1 / weight - variance) * free / std::max(free - 2, 0.5);
    return mean;
}

/// The poles as the mean over the places, and their covariances; N: their information. @param b  what moves them, a column a
/// response
void meet_places(const std::vector<complex>& poles, const problem& all, const VectorXd& weight,
                 const std::vector<Index>& places, const MatrixXd& N, const MatrixXd& b, modal_fit& out) {
    const Eigen::LDLT<MatrixXd> factor(N);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return;
    const MatrixXd inverse = factor.solve(MatrixXd::Identity(N.rows(), N.cols()));
    const std::vector<complex> repeats = repetition(all);
    const Index count = *std::max_element(places.begin(), places.end()) + 1;
    for (std::size_t m = 0; m < poles.size(); ++m) {
        const auto k = static_cast<Index>(m);
        const MatrixXd rows = inverse.middleRows(2 * k, 2), moves = rows * b;
        MatrixXd of_place = MatrixXd::Zero(2, count);
        VectorXd share = VectorXd::Zero(count);
        for (Index c = 0; c < b.cols(); ++c) {
            MatrixXd own = all.gram.middleCols(2 * k, 2) * turn_of(all, k, c);
            for (Index j = 0; 2 * j < own.rows(); ++j)
                own.middleRows(2 * j, 2) = (turn_of(all, j, c).transpose() * own.middleRows(2 * j, 2)).eval();
            const Index place = places[static_cast<std::size_t>(c)];
            of_place.col(place) += moves.col(c);
            share[place] += weight[c] * (rows * own).trace() / 2;
        }
        const auto [of_pole, of_residues] = local_noise(all, poles[m], weight, k, repeats);
        out.more_noise[k] = of_residues;
        Eigen::Matrix2d covariance = of_pole * inverse.block<2, 2>(2 * k, 2 * k);
        const double re = meet(of_place.row(0), share, covariance(0, 0)),
                     im = meet(of_place.row(1), share, covariance(1, 1));
        out.poles[m] += all.w_high * complex(re, im);
        out.covariance.emplace_back(all.w_high * all.w_high * covariance);
    }
}

} // namespace

modal_fit fit_modes(const response_set& set, const std::vector<Index>& places, std::vector<complex> poles, int steps,
                    double window_s, double sample_s) {
    problem all = make_problem(set, window_s, sample_s);
    for (complex& pole : poles) pole /= all.w_high;
    const std::vector<complex> start = poles;
    VectorXd weight = VectorXd::Ones(set.H.cols());
    MatrixXd N;
    (void)fit_linear(poles, weight, all);
    for (int step = 0; step < steps; ++step) {
        weight = weights(all);
        weigh_lines(weight, all);
        const double cost = fit_linear(poles, weight, all);
        const VectorXd b = normal_equations(poles, weight, all, N).rowwise().sum();
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
    weight = weights(all);
    const MatrixXd b = normal_equations(poles, weight, all, N);
    modal_fit out;
    const auto n = static_cast<Index>(poles.size());
    out.residues.resize(n, weight.size());
    for (Index k = 0; k < n; ++k) {
        out.poles.push_back(poles[static_cast<std::size_t>(k)] * all.w_high);
        out.residues.row(k).real() = all.w_high * all.coefficients.row(2 * k);
        out.residues.row(k).imag() = all.w_high * all.coefficients.row(2 * k + 1);
    }
    out.variance = weight.cwiseInverse();
    out.unlikeliness = out.variance.array().log().mean() - 2 * all.root.array().log().mean();
    out.unit_variance.resize(n);
    for (Index k = 0; k < n; ++k) out.unit_variance[k] = all.w_high * all.w_high * all.inverse.row(2 * k).squaredNorm();
    out.more_noise = VectorXd::Ones(n);
    meet_places(poles, all, weight, places, N, b, out);
    return out;
}

} // namespace okid_host
