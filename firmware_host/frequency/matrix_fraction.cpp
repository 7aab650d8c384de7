// SPDX-License-Identifier: MIT
// PURPOSE  poles of measured frequency responses over many orders, in the whole band and in narrower ones
// METHOD   H(f) A(z) = B(z) + error, z = exp(j theta), theta over the band 0 .. pi: linear least squares in the real
//          matrices of B and A, B eliminated output by output (Toeplitz sums, Cholesky). A_0 = I keeps noise poles
//          unstable and errs in damping, A_n = I errs less and has poles of noise: both are looked at. Narrower bands, each
//          half over the next, have fewer modes: weak ones show there, and noise has other poles in each
// REFERENCE Guillaume, Verboven, Vanlanduit, Van der Auweraer, Peeters (2003); Cauberghe, Guillaume, Verboven,
//          Vanlanduit, Parloo (2004)
// NUMERICS outputs and inputs at unit rms; poles from a companion matrix without an inverse in both normalisations
#include "matrix_fraction.hpp"

#include "consensus/quantity.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index most_states = 100;   // of the companion matrix: its poles cost the third power
constexpr Index most_references = 8; // inputs whose poles are sought together
constexpr Index largest_degree = 100, least_degree = 12;
constexpr int degrees_looked_at = 12;
constexpr Index narrowest_band = 160;     // lines
constexpr Index narrowings = 2;           // halvings of the band
constexpr double edge_of_band = 0.08;     // of a narrower one: its poles answer for what lies outside
constexpr double ridge = 1e-10;           // of the mean power: without noise more coefficients fit than are needed
constexpr double smallest_weighed = 1e-3; // of the largest response: below it the weight rises no more
constexpr double least_signal = 0.01;     // share of it in an output that is noise

/// The responses at unit rms, lines weighted, and their Fourier sums over the axis of the fraction.
struct fraction_sums {
    Index n_y, n_u, degree;          // degree: the largest
    double low_hz = 0, width_hz = 0; // of the band
    VectorXd scale_y;
    VectorXd R;                            // (degree + 1)
    MatrixXd S_even, S_odd, T_even, T_odd; // a column a response or a pair of inputs
};

/// rms of all responses together, smoothed over 1 % of the lines to either side.
VectorXd level_of(const MatrixXcd& H) {
    const VectorXd power = H.rowwise().squaredNorm();
    const Index lines = power.size(), reach = std::max<Index>(2, lines / 100);
    VectorXd out(lines);
    for (Index l = 0; l < lines; ++l) {
        const Index first = std::max<Index>(0, l - reach), last = std::min(lines, l + reach + 1);
        out[l] = std::sqrt(power.segment(first, last - first).mean());
    }
    return out / out.maxCoeff();
}

/// Every column of inputs, or as many as are sought together, evenly chosen.
std::vector<Index> references(Index n_u) {
    std::vector<Index> out;
    const Index count = std::min(n_u, most_references);
    for (Index k = 0; k < count; ++k) out.push_back(k * n_u / count);
    return out;
}

fraction_sums sum_up(const MatrixXcd& H, const VectorXd& weight, Index n_y, const std::vector<double>& f,
                     Index degree) {
    fraction_sums out{n_y, H.cols() / n_y, degree, 0, 0, {}, {}, {}, {}, {}, {}};
    const double step = (f.back() - f.front()) / static_cast<double>(f.size() - 1);
    out.low_hz = f.front() < 3 * step ? 0 : f.front(); // a band that begins at 0 keeps the symmetry of real systems
    out.width_hz = f.back() - out.low_hz;
    const Index lines = H.rows();
    MatrixXd cosine(lines, degree + 1), sine(lines, degree + 1);
    for (Index l = 0; l < lines; ++l) {
        const double theta = M_PI * (f[static_cast<std::size_t>(l)] - out.low_hz) / out.width_hz;
        for (Index k = 0; k <= degree; ++k) {
            cosine(l, k) = std::cos(theta * static_cast<double>(k));
            sine(l, k) = std::sin(theta * static_cast<double>(k));
        }
    }
    const VectorXd w = weight.array().square();
    out.R = cosine.transpose() * w;
    const MatrixXcd weighted = w.asDiagonal() * H;
    out.S_even = -cosine.transpose() * weighted.real();
    out.S_odd = sine.transpose() * weighted.imag();
    MatrixXcd pairs = MatrixXcd::Zero(lines, out.n_u * out.n_u);
    for (Index i = 0; i < out.n_u; ++i)
        for (Index j = 0; j < out.n_u; ++j)
            for (Index o = 0; o < n_y; ++o)
                pairs.col(i + out.n_u * j).array() +=
                    H.col(o + n_y * i).conjugate().array() * weighted.col(o + n_y * j).array();
    out.T_even = cosine.transpose() * pairs.real();
    out.T_odd = -sine.transpose() * pairs.imag();
    return out;
}

/// Toeplitz value at distance b - a.
double at_lag(const MatrixXd& even, const MatrixXd& odd, Index b_minus_a, Index column) {
    const Index k = std::abs(b_minus_a);
    return even(k, column) + (b_minus_a < 0 ? -odd(k, column) : odd(k, column));
}

/// B and A of one degree: numerators are R^-1 S of each output, `M` what is left to minimise over A.
struct reduced_equations {
    MatrixXd M;
    std::vector<MatrixXd> X;
};

reduced_equations reduce(const fraction_sums& sums, Index n) {
    const Index n_u = sums.n_u, size = (n + 1) * n_u;
    reduced_equations out;
    MatrixXd R(n + 1, n + 1);
    for (Index a = 0; a <= n; ++a)
        for (Index b = 0; b <= n; ++b) R(a, b) = sums.R[std::abs(b - a)];
    R.diagonal() *= 1 + 1e-12;
    const Eigen::LLT<MatrixXd> factor(R);
    out.M.resize(size, size);
    for (Index a = 0; a <= n; ++a)
        for (Index b = 0; b <= n; ++b)
            for (Index i = 0; i < n_u; ++i)
                for (Index j = 0; j < n_u; ++j)
                    out.M(a * n_u + i, b * n_u + j) = at_lag(sums.T_even, sums.T_odd, b - a, i + n_u * j);
    MatrixXd S(n + 1, size);
    for (Index o = 0; o < sums.n_y; ++o) {
        for (Index a = 0; a <= n; ++a)
            for (Index b = 0; b <= n; ++b)
                for (Index i = 0; i < n_u; ++i)
                    S(a, b * n_u + i) = at_lag(sums.S_even, sums.S_odd, b - a, o + sums.n_y * i);
        const MatrixXd half = factor.matrixL().solve(S);
        out.M.noalias() -= half.transpose() * half;
        out.X.emplace_back(factor.matrixU().solve(half));
    }
    out.M.diagonal().array() += ridge * out.M.diagonal().mean();
    return out;
}

/// A_0 .. A_n below each other, one of them the identity.
MatrixXd denominators(const MatrixXd& M, Index n_u, bool lowest) {
    const Index size = M.rows(), left = size - n_u, first = lowest ? n_u : 0, fixed = lowest ? 0 : left;
    MatrixXd out(size, n_u);
    out.middleRows(fixed, n_u).setIdentity();
    out.middleRows(first, left) = -M.block(first, first, left, left).ldlt().solve(M.block(first, fixed, left, n_u));
    return out;
}

/// Roots z of det sum z^k A_k = 0 with their null vectors v, as columns.
void solve_fraction(const MatrixXd& A, Index n_u, bool lowest, Eigen::VectorXcd& z, MatrixXcd& v) {
    const Index n = A.rows() / n_u - 1, size = n * n_u;
    MatrixXd companion = MatrixXd::Zero(size, size);
    companion.topRightCorner(size - n_u, size - n_u).setIdentity();
    for (Index k = 0; k < n; ++k) // lowest: of the polynomial in 1 / z
        companion.block(size - n_u, k * n_u, n_u, n_u) = -A.middleRows((lowest ? n - k : k) * n_u, n_u);
    const Eigen::EigenSolver<MatrixXd> solver(companion);
    z = solver.eigenvalues();
    if (lowest) z = z.cwiseInverse();
    v = solver.eigenvectors().topRows(n_u);
}

void add_poles(const fraction_sums& sums, Index n, bool lowest, const reduced_equations& equations,
               consensus_run& run) {
    const Index n_u = sums.n_u;
    const MatrixXd A = denominators(equations.M, n_u, lowest);
    Eigen::VectorXcd z;
    MatrixXcd v;
    solve_fraction(A, n_u, lowest, z, v);
    std::vector<MatrixXd> B;
    for (const MatrixXd& X : equations.X) B.emplace_back(-X * A);
    for (Index k = 0; k < z.size(); ++k) {
        const complex turn = std::log(z[k]);
        const complex lambda = 2 * sums.width_hz * turn + complex(0, 2 * M_PI * sums.low_hz);
        const double size = std::abs(lambda), zeta = -lambda.real() / size;
        if (!(turn.imag() > 0 && turn.imag() < M_PI) || !(zeta > 0 && zeta < 1)) continue;
        run_pole pole{static_cast<int>(n), size / (2 * M_PI), zeta, 0, 1, {}};
        Eigen::VectorXcd powers(n + 1);
        powers[0] = 1;
        for (Index a = 1; a <= n; ++a) powers[a] = powers[a - 1] * z[k];
        for (Index o = 0; o < sums.n_y; ++o) {
            const Eigen::RowVectorXcd row = powers.transpose() * B[static_cast<std::size_t>(o)];
            pole.shape.push_back((row * v.col(k)).value() * sums.scale_y[o]);
        }
        pole.mpc = shape_collinearity(pole.shape, {});
        run.poles.push_back(std::move(pole));
    }
}

/// Runs over the lines of one band: weights of the lines (of the whole band three, else one), both normalisations. @param noise
/// share of it in each output: one that measures nothing must not rule the poles
std::vector<consensus_run> fit_band(MatrixXcd H, Index n_y, const std::vector<double>& f, const VectorXd& noise,
                                    bool whole) {
    const Index n_u = H.cols() / n_y, lines = H.rows();
    const auto unit = [](double norm) { return norm > 0 ? norm : 1.0; };
    for (Index i = 0; i < n_u; ++i) H.middleCols(n_y * i, n_y) /= unit(H.middleCols(n_y * i, n_y).norm());
    VectorXd scale_y(n_y);
    for (Index o = 0; o < n_y; ++o) {
        double power = 0;
        for (Index i = 0; i < n_u; ++i) power += H.col(o + n_y * i).squaredNorm();
        scale_y[o] = unit(std::sqrt(power / std::max(1 - noise[o], least_signal)));
        for (Index i = 0; i < n_u; ++i) H.col(o + n_y * i) /= scale_y[o];
    }
    const Index most = whole ? largest_degree : largest_degree / 2;
    const Index degree = std::clamp(std::min(most_states / n_u, lines / 4), least_degree, most);
    const Index step = std::clamp<Index>((degree - least_degree / 2) / degrees_looked_at, 1, 4);
    const VectorXd level = level_of(H).cwiseMax(smallest_weighed);
    std::vector<consensus_run> runs;
    for (const double power : whole ? std::vector<double>{0.0, 0.5, 1.0} : std::vector<double>{0.5}) {
        fraction_sums sums = sum_up(H, level.array().pow(-power), n_y, f, degree);
        sums.scale_y = scale_y;
        consensus_run run;
        for (Index n = degree - (degrees_looked_at - 1) * step; n <= degree; n += step)
            if (n >= 3) run.orders.push_back(static_cast<int>(n));
        consensus_run other = run; // A_n = I
        for (const int n : run.orders) {
            const reduced_equations equations = reduce(sums, n);
            add_poles(sums, n, true, equations, run);
            add_poles(sums, n, false, equations, other);
        }
        runs.push_back(std::move(run));
        runs.push_back(std::move(other));
    }
    return runs;
}

} // namespace

std::vector<consensus_run> fit_matrix_fractions(const response_set& set) {
    const std::vector<Index> chosen = references(set.n_u());
    const auto n_u = static_cast<Index>(chosen.size()), n_y = set.n_y(), lines = set.lines();
    MatrixXcd H(lines, n_y * n_u);
    for (Index i = 0; i < n_u; ++i)
        H.middleCols(n_y * i, n_y) = set.H.middleCols(n_y * chosen[static_cast<std::size_t>(i)], n_y);
    const VectorXd noise = noise_shares(set);
    std::vector<consensus_run> runs;
    for (Index part = 0; part <= narrowings && (part == 0 || (lines >> part) >= narrowest_band); ++part)
        for (Index width = lines >> part, first = 0; first + width <= lines; first += std::max<Index>(1, width / 2)) {
            const auto f = set.frequency_hz.begin() + first;
            const std::vector<double> band(f, f + width);
            const double edge = edge_of_band * (band.back() - band.front());
            const double bottom = first == 0 ? 0 : band.front() + edge,
                         top = first + width + width / 2 > lines ? set.frequency_hz.back() : band.back() - edge;
            for (consensus_run& run : fit_band(H.middleRows(first, width), n_y, band, noise, part == 0)) {
                run.fs_hz = set.frequency_hz.back();
                run.bottom = bottom / run.fs_hz;
                run.top = top / run.fs_hz;
                run.rows = static_cast<int>(lines);
                link_tracks(run);
                runs.push_back(std::move(run));
            }
        }
    return runs;
}

} // namespace okid_host
