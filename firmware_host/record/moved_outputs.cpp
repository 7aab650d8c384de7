// SPDX-License-Identifier: MIT
// PURPOSE  were the sensors of ambient records at the same places?
// METHOD   first singular vector of the spectral matrix at each mode, of each record by itself (Brincker et al. 2001)
#include "moved_outputs.hpp"

#include "consensus/demodulation.hpp"
#include "record_check.hpp"
#include "result/judgement.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double periods_of_transform = 8, transforms = 8; // in a block at least, of a record at least

/// How the outputs of one file move at a mode, each in units of its spread.
struct principal_shape {
    Eigen::MatrixXcd spectra; ///< of all blocks
    Eigen::VectorXcd shape;
    double share = 0; ///< of the power that is of this shape

    void find() {
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd> solver(spectra);
        const double all = solver.eigenvalues().sum();
        if (!(all > 0)) return;
        share = solver.eigenvalues().tail<1>()[0] / all;
        shape = solver.eigenvectors().rightCols<1>();
    }
};

void add_blocks(const record_set& set, const record_data& record, const std::vector<double>& unit, double frequency,
                std::size_t block, Eigen::MatrixXcd& to) {
    const std::size_t n = set.n_y;
    const double* rows = set.rows(record);
    std::vector<std::vector<std::complex<double>>> along(n);
    for (std::size_t o = 0; o < n; ++o)
        demodulate(record.count, frequency, block, [&](std::size_t i) { return unit[o] * rows[i * n + o]; }, along[o]);
    Eigen::VectorXcd one(static_cast<Eigen::Index>(n));
    for (std::size_t b = 0; b < along[0].size(); ++b) {
        for (std::size_t o = 0; o < n; ++o) one[static_cast<Eigen::Index>(o)] = along[o][b];
        if (one.allFinite()) to += one * one.adjoint();
    }
}

using file_shapes = std::vector<std::pair<std::string, principal_shape>>;

/// Of each file; pieces of one file are one.
file_shapes shapes_of_files(const record_set& set, const listed_mode& mode, double fs_hz,
                            const std::vector<double>& unit) {
    const auto n = static_cast<Eigen::Index>(set.n_y);
    const double f = mode.frequency_hz / fs_hz;
    file_shapes out;
    for (const record_data& record : set.records) {
        if (out.empty() || out.back().first != record.path)
            out.push_back({record.path, {Eigen::MatrixXcd::Zero(n, n), {}, 0}});
        const double wanted = std::max(periods_of_transform / f, 0.5 / (mode.damping_ratio * f)),
                     most = static_cast<double>(record.count) / transforms;
        const auto block = static_cast<std::size_t>(std::min(wanted, std::max(most, periods_of_transform / f)));
        add_blocks(set, record, unit, f, block, out.back().second.spectra);
    }
    for (auto& [path, one] : out) one.find();
    return out;
}

double mac_of(const principal_shape& a, const principal_shape& b) {
    return std::min(a.share, b.share) < judgement::one_shape ? NAN : std::norm(a.shape.dot(b.shape));
}

bool side_by_side(const listed_mode& a, const listed_mode& b) {
    const double width = a.damping_ratio * a.frequency_hz + b.damping_ratio * b.frequency_hz;
    return std::abs(a.frequency_hz - b.frequency_hz) < judgement::most_widths * width;
}

/// Of all modes, how the files move at them. Sensors that were moved list a mode twice, side by side.
class listed_shapes {
  public:
    listed_shapes(const std::vector<listed_mode>& modes, const std::optional<deviations>& sigma, double fs_hz,
                  const record_set& set)
        : modes_(modes) {
        std::vector<double> unit;
        for (const output_spread& one : spreads_of(set))
            unit.push_back(one.squares > 0 ? std::sqrt(one.count / one.squares) : 0);
        if (sigma && sigma->frequency_hz.size() == modes.size()) deviation_hz_ = sigma->frequency_hz;
        deviation_hz_.resize(modes.size(), NAN);
        for (const listed_mode& mode : modes)
            shapes_.push_back(mode.in_model && mode.damping_ratio > 0 ? shapes_of_files(set, mode, fs_hz, unit)
                                                                      : file_shapes());
    }

    const file_shapes& of(std::size_t k) const { return shapes_[k]; }

    /// Is it one mode, and not the second entry of one that was counted?
    bool counts(std::size_t k) const {
        if (shapes_[k].empty()) return false;
        for (std::size_t i = 0; i < modes_.size(); ++i)
            if (i != k && !shapes_[i].empty() && side_by_side(modes_[i], modes_[k]) && (i < k || are_two(i, k)))
                return false;
        return true;
    }

  private:
    /// Their frequencies tell, or a file shows two shapes.
    bool are_two(std::size_t i, std::size_t k) const {
        const double apart_hz = std::abs(modes_[i].frequency_hz - modes_[k].frequency_hz);
        if (apart_hz > judgement::surely_apart * std::hypot(deviation_hz_[i], deviation_hz_[k]))
            return true; // never of NaN
        for (std::size_t r = 0; r < shapes_[k].size(); ++r)
            if (mac_of(shapes_[i][r].second, shapes_[k][r].second) < judgement::same_shape) return true;
        return false;
    }

    const std::vector<listed_mode>& modes_;
    std::vector<double> deviation_hz_;
    std::vector<file_shapes> shapes_;
};

} // namespace

std::string moved_outputs_text(const std::vector<listed_mode>& modes, const std::optional<deviations>& sigma,
                               double fs_hz, const record_set& set) {
    if (set.n_u > 0 || set.n_y < judgement::fewest_to_compare || set.records.size() < 2) return "";
    struct compared {
        std::string path;
        std::size_t seen = 0, other = 0;
        double least = 1;
    };
    const listed_shapes listed(modes, sigma, fs_hz, set);
    std::vector<compared> files;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        if (!listed.counts(k)) continue;
        const file_shapes& shapes = listed.of(k);
        files.resize(shapes.size());
        for (std::size_t r = 0; r < files.size(); ++r) {
            files[r].path = shapes[r].first;
            const double mac = mac_of(shapes[0].second, shapes[r].second);
            if (std::isnan(mac)) continue;
            ++files[r].seen;
            files[r].other += mac < judgement::moved_shape;
            files[r].least = std::min(files[r].least, mac);
        }
    }
    for (const compared& file : files)
        if (file.other >= judgement::fewest_moved && 3 * file.other >= file.seen)
            return fmt::format(
                "{} moves otherwise than {} at {} of {} modes (MAC down to {:.2f}). Were the sensors at other "
                "places? Then an output needs the name of its place, not of its channel, and --setups. Or "
                "the wind turned, and the structure has two modes at each frequency",
                file.path, files[0].path, file.other, file.seen, file.least);
    return "";
}

} // namespace okid_host
