// SPDX-License-Identifier: MIT
// PURPOSE  what measured forces explain of a mode
// METHOD   least squares over blocks: the amplitude that the outputs show by the answers of poles to the forces
#include "explained_by_forces.hpp"

#include "demodulation.hpp"
#include "result/judgement.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

using complex = std::complex<double>;

/// Of poles, block by block at one frequency: the free vibration from the begin of each record, and the answer to each force.
struct pole_blocks {
    std::vector<std::vector<complex>> free, driven;

    /// @param rings_on  else nothing is added to `free`
    void add(const record_level& level, std::size_t m, std::size_t n_u, const consensus_mode& mode, double share,
             std::size_t block, bool rings_on) {
        const double zeta = std::min(mode.damping_ratio, 1.0), own = mode.frequency_hz / level.fs_hz;
        const complex pole = std::exp(2 * M_PI * own * complex(-zeta, std::sqrt(1 - zeta * zeta)));
        std::vector<complex> state;
        const auto run = [&](const sample_rows& rows, complex now, auto force, std::vector<complex>& out) {
            state.assign(rows.size() / m, 0);
            for (std::size_t t = 0; t < state.size(); ++t) state[t] = now = pole * now + force(t);
            demodulate(state.size(), share, block, [&](std::size_t t) { return state[t]; }, out);
        };
        const std::size_t first = driven.size();
        driven.resize(first + n_u);
        for (const sample_rows& rows : level.records) {
            const std::size_t before = driven[first].size();
            for (std::size_t k = 0; k < n_u; ++k)
                run(rows, 0, [&](std::size_t t) { return rows[t * m + k]; }, driven[first + k]);
            if (!rings_on) continue;
            free.emplace_back(before);
            run(rows, 1, [](std::size_t) { return 0.0; }, free.back());
        }
        for (auto& column : free) column.resize(driven[first].size());
    }
};

/// The square of b that these columns leave, for each degree of freedom.
double left_by(const Eigen::MatrixXcd& C, const Eigen::VectorXcd& b) {
    const auto freedom = static_cast<double>(b.size() - C.cols());
    if (C.cols() == 0) return b.squaredNorm() / freedom;
    return (b - C * C.colPivHouseholderQr().solve(b)).squaredNorm() / freedom;
}

} // namespace

double explained_by_forces(const record_level& level, std::size_t m, std::size_t n_u, bool rings_on,
                           const consensus_mode& mode, const std::vector<consensus_mode>& modes, std::size_t block,
                           const std::vector<std::complex<double>>& seen) {
    const double share = mode.frequency_hz / level.fs_hz, cycle_hz = level.fs_hz / static_cast<double>(block);
    pole_blocks own, beside; // what a block does not part from the mode, and what leaks into it
    own.add(level, m, n_u, mode, share, block, rings_on);
    const std::size_t each = own.free.size() + n_u;
    std::size_t numbers = each;
    for (const consensus_mode& other : modes) {
        const double apart = std::abs(other.frequency_hz - mode.frequency_hz) / cycle_hz;
        if (&other == &mode || other.agreement < judgement::least_agreement || apart > judgement::leaks ||
            judgement::blocks_a_number * (numbers + each) >= seen.size())
            continue;
        (apart < judgement::one_to_a_block ? own : beside).add(level, m, n_u, other, share, block, rings_on);
        numbers += each;
    }
    std::vector<std::vector<complex>> columns = own.free;
    for (const auto* more : {&beside.free, &beside.driven, &own.driven})
        columns.insert(columns.end(), more->begin(), more->end());
    Eigen::MatrixXcd C(static_cast<Eigen::Index>(seen.size()), static_cast<Eigen::Index>(columns.size()));
    Eigen::VectorXcd b(C.rows());
    Eigen::Index complete = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
        complex sum = seen[i];
        for (std::size_t k = 0; k < columns.size(); ++k)
            sum += C(complete, static_cast<Eigen::Index>(k)) = columns[k][i];
        b[complete] = seen[i];
        complete += !std::isnan(sum.real()) && !std::isnan(sum.imag());
    }
    if (complete <= C.cols()) return 0;
    C.conservativeResize(complete, C.cols());
    b.conservativeResize(complete);
    if (rings_on) { // at a hit all modes answer, in its block alone
        Eigen::VectorXd size = b.cwiseAbs();
        std::sort(size.begin(), size.end());
        const Eigen::VectorXcd weight = (b.cwiseAbs().array() + size[complete / 2]).inverse().cast<complex>();
        C = weight.asDiagonal() * C;
        b = weight.asDiagonal() * b;
    }
    const double before = left_by(C.leftCols(C.cols() - static_cast<Eigen::Index>(own.driven.size())), b);
    if (before * static_cast<double>(complete) < judgement::goes_on * b.squaredNorm()) return 0;
    return 1 - left_by(C, b) / before;
}

} // namespace okid_host
