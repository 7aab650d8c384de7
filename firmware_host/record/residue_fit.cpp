// SPDX-License-Identifier: MIT
// PURPOSE  B and D of given modes from records, and what other records' B and D would leave of them
// METHOD   with poles mu and shapes c known, y = sum_k Re(c_k b_k z_k) + D u, z_k+ = mu_k z_k + u, is linear in b and D: one
//          Gram matrix of [z, u, y] a record holds everything, so that any B and D are judged without another pass
// NUMERICS normal equations at unit diagonal with a ridge of 1e-10: coefficients that the record does not excite stay small
#include "residue_fit.hpp"

#include "gram_sum.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double ridge = 1e-10;

/// Modes in the model: poles and shapes.
struct modal_basis {
    std::vector<complex> mu;
    std::vector<const listed_mode*> modes;
};

modal_basis basis_of(const std::vector<listed_mode>& modes, double fs_hz) {
    modal_basis out;
    for (const listed_mode& mode : modes) {
        if (!mode.in_model) continue;
        out.mu.push_back(discrete_pole(mode, 1 / fs_hz));
        out.modes.push_back(&mode);
    }
    return out;
}

/// Gram matrix of [Re z, Im z of each mode and drive; u; y]; a drive is an input or, last, the initial state.
MatrixXd gram_of(const modal_basis& basis, const record_set& set, const record_data& record, bool at_rest, int beside,
                 double& rows) {
    const std::size_t n = basis.mu.size(), drives = set.n_u + (at_rest ? 0 : 1);
    const std::size_t near = 2 * static_cast<std::size_t>(beside) * set.n_u;
    const auto size = static_cast<Index>(2 * n * drives + set.channels() + near);
    gram_sum sum(size);
    std::vector<complex> z(n * drives);
    if (!at_rest) std::fill(z.begin() + static_cast<std::ptrdiff_t>(n * set.n_u), z.end(), complex(1));
    for (std::size_t t = 0; t < record.count; ++t) {
        const double* row = set.rows(record) + t * set.channels();
        if (std::any_of(row, row + set.n_u, [](double u) { return std::isnan(u); })) break;
        if (std::none_of(row + set.n_u, row + set.channels(), [](double y) { return std::isnan(y); })) {
            auto x = sum.next();
            for (std::size_t k = 0; k < z.size(); ++k) {
                x[static_cast<Index>(2 * k)] = z[k].real();
                x[static_cast<Index>(2 * k) + 1] = z[k].imag();
            }
            std::copy_n(row, set.channels(), x.data() + 2 * z.size());
            double* other = x.data() + 2 * z.size() + set.channels();
            for (std::size_t lag = 1; lag <= static_cast<std::size_t>(beside); ++lag)
                for (const bool before : {true, false}) {
                    const bool there = before ? t >= lag : t + lag < record.count;
                    const double* const force = set.rows(record) + (before ? t - lag : t + lag) * set.channels();
                    for (std::size_t j = 0; j < set.n_u; ++j) *other++ = there ? force[j] : 0;
                }
            sum.keep();
        }
        for (std::size_t j = 0; j < drives; ++j)
            for (std::size_t k = 0; k < n; ++k)
                z[j * n + k] = basis.mu[k] * z[j * n + k] + (j < set.n_u ? row[j] : 0.0);
    }
    sum.fold();
    rows += static_cast<double>(sum.kept());
    return sum.values();
}

/// What each unknown adds to output o, in the rows of the Gram matrix: modes of each drive, then D.
MatrixXd map_of(const modal_basis& basis, const record_set& set, std::size_t drives, std::size_t o, int beside) {
    const std::size_t n = basis.mu.size(), states = 2 * n * drives,
                      near = 2 * static_cast<std::size_t>(beside) * set.n_u;
    MatrixXd T = MatrixXd::Zero(static_cast<Index>(states + set.channels() + near),
                                static_cast<Index>(states + set.n_y * (set.n_u + near)));
    for (std::size_t j = 0; j < drives; ++j)
        for (std::size_t k = 0; k < n; ++k) {
            const auto at = static_cast<Index>(2 * (j * n + k));
            const complex c = basis.modes[k]->shape[o];
            T.block<2, 2>(at, at) << c.real(), -c.imag(), -c.imag(), -c.real();
        }
    for (std::size_t j = 0; j < set.n_u; ++j)
        T(static_cast<Index>(states + j), static_cast<Index>(states + j * set.n_y + o)) = 1;
    for (std::size_t j = 0; j < near; ++j)
        T(static_cast<Index>(states + set.channels() + j), static_cast<Index>(states + (set.n_u + j) * set.n_y + o)) =
            1;
    return T;
}

/// The unknowns of the initial state out of the equations: those at first .. first + count - 1.
void eliminate(Index first, Index count, residue_sums& sums) {
    std::vector<Index> kept, gone;
    for (Index i = 0; i < sums.h.size(); ++i) (i >= first && i < first + count ? gone : kept).push_back(i);
    MatrixXd own = sums.N(gone, gone);
    own.diagonal() *= 1 + ridge;
    own.diagonal().array() += 1e-300;
    const Eigen::LDLT<MatrixXd> solver(own);
    const VectorXd x0 = solver.solve(sums.h(gone));
    sums.left = sums.energy - sums.h(gone).dot(x0);
    const MatrixXd cross = sums.N(gone, kept);
    const MatrixXd reduced = sums.N(kept, kept) - cross.transpose() * solver.solve(cross);
    const VectorXd rest = sums.h(kept) - cross.transpose() * x0;
    sums.N = reduced;
    sums.h = rest;
}

} // namespace

std::vector<residue_sums> sum_residues(const std::vector<listed_mode>& modes, double fs_hz, const record_set& set,
                                       bool at_rest, int beside) {
    const modal_basis basis = basis_of(modes, fs_hz);
    const std::size_t n = basis.mu.size(), drives = set.n_u + (at_rest ? 0 : 1);
    const auto states = static_cast<Index>(2 * n * drives);
    std::vector<MatrixXd> grams;
    VectorXd power = VectorXd::Constant(static_cast<Index>(set.n_y), 1e-300);
    std::vector<double> rows(set.records.size());
    for (const record_data& record : set.records) {
        grams.push_back(gram_of(basis, set, record, at_rest, beside, rows[grams.size()]));
        power += grams.back().diagonal().segment(states + static_cast<Index>(set.n_u), static_cast<Index>(set.n_y));
    }
    std::vector<residue_sums> out(grams.size());
    for (std::size_t o = 0; o < set.n_y; ++o) {
        const MatrixXd T = map_of(basis, set, drives, o, beside);
        const auto at = states + static_cast<Index>(set.n_u + o);
        const double weight = 1 / power[static_cast<Index>(o)];
        for (std::size_t r = 0; r < grams.size(); ++r) {
            if (o == 0) out[r].N = MatrixXd::Zero(T.cols(), T.cols()), out[r].h = VectorXd::Zero(T.cols());
            out[r].N.noalias() += weight * (T.transpose() * (grams[r] * T));
            out[r].h.noalias() += weight * (T.transpose() * grams[r].col(at));
            out[r].energy += weight * grams[r](at, at);
            out[r].samples = rows[r] * static_cast<double>(set.n_y);
        }
    }
    for (residue_sums& sums : out) {
        sums.left = sums.energy;
        if (!at_rest) eliminate(static_cast<Index>(2 * n * set.n_u), static_cast<Index>(2 * n), sums);
    }
    return out;
}

void keep_samples_beside(std::vector<residue_sums>& records, int beside, std::size_t n_y) {
    const auto cut = [](const residue_sums& sums, Index count) {
        return residue_sums{sums.N.topLeftCorner(count, count), sums.h.head(count), sums.left, sums.energy,
                            sums.samples};
    };
    std::vector<residue_sums> best;
    double least = INFINITY;
    for (int lag = 0; lag <= beside; ++lag) {
        const Index count = records.front().h.size() - 2 * (beside - lag) * static_cast<Index>(n_y);
        std::vector<residue_sums> all;
        std::vector<const residue_sums*> each;
        for (const residue_sums& sums : records) all.push_back(cut(sums, count));
        for (const residue_sums& sums : all) each.push_back(&sums);
        const VectorXd x = fit_residues(each);
        double left = 0, samples = 0;
        for (const residue_sums& sums : all) left += sums.energy * residue_left(sums, x), samples += sums.samples;
        const double cost = samples * std::log(std::max(left, 1e-300)) + static_cast<double>(count) * std::log(samples);
        if (cost < least) least = cost, best = std::move(all);
    }
    records = std::move(best);
}

VectorXd fit_residues(const std::vector<const residue_sums*>& records) {
    MatrixXd N = records.front()->N;
    VectorXd h = records.front()->h;
    for (std::size_t r = 1; r < records.size(); ++r) N += records[r]->N, h += records[r]->h;
    const VectorXd scale = N.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    MatrixXd scaled = scale.asDiagonal() * N * scale.asDiagonal();
    scaled.diagonal().array() += ridge;
    return scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * h);
}

double residue_left(const residue_sums& record, const VectorXd& x) {
    return std::max(0.0, record.left - 2 * record.h.dot(x) + x.dot(record.N * x)) / std::max(record.energy, 1e-300);
}

} // namespace okid_host
