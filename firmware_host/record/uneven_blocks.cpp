// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of ambient modes where the power changes: storms, trains, nights
// METHOD   the jackknife takes a block's information for its share W of the energy, as it is where forces are known or a structure
//          rings down. Ambient vibration tells as much in a calm minute as in a stormy one: what a block says by itself varies by
//          v, whatever its W, and the whole by v sum W^2. With d = (1 - W) (theta_j - theta), theta_j without block j and about
//          their median, E d^2 = v W^2 (1 - 2 W + min(W, sum W^2)) then; by energies E d^2 = W (1 - W) var theta. The likelier of
//          both holds, of frequency and damping together; the energies only where the evidence is strong, because one storm
//          alone says little of its own error
// REFERENCE Efron, Stein (1981); Busing, Meijer, van der Leeden (1999)
#include "uneven_blocks.hpp"

#include "files/order_statistics.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double strong_evidence = 10; // twice the logarithm of a ratio of likelihoods

/// Squares of deviations beside what is expected of them.
struct squares_fit {
    double sum = 0, unit = 0, mean = 0, log = 0;

    void add(double square, double expected, double weight) {
        sum += weight * square;
        unit += weight * expected;
        mean += square / expected;
        log += std::log(expected);
    }
    double scale() const { return sum / unit; }
};

/// Of one quantity: variances of the whole, and twice the logarithm of how much likelier the one by energies is.
struct both_ways {
    double by_energy = 0, by_length = 0, evidence = 0;
};

both_ways judge(const std::vector<double>& moved, const std::vector<double>& shares) {
    const double centre = median(moved); // what a model without the storm has beyond linear terms shifts every mean
    double squares = 0;
    for (const double W : shares) squares += W * W;
    squares_fit energy, length;
    for (std::size_t j = 0; j < shares.size(); ++j) {
        const double W = shares[j], square = std::pow((1 - W) * (moved[j] - centre), 2);
        energy.add(square, W * (1 - W), 1);
        length.add(square, W * W * (1 - 2 * W + std::min(W, squares)),
                   std::pow(W, -1.5)); // sqrt(W) of what each says by itself: a silent block says nothing
    }
    return {energy.scale(), squares * length.scale(),
            static_cast<double>(shares.size()) * std::log(length.mean / energy.mean) + length.log - energy.log};
}

} // namespace

widening widening_of(const std::vector<mode_shift>& shifts, const std::vector<double>& shares) {
    const bool whole = !shifts.empty() && shifts.size() == shares.size() &&
                       std::all_of(shares.begin(), shares.end(), [](double W) { return W > 0 && W < 1; });
    if (!whole) return {};
    std::vector<double> f, zeta;
    for (const mode_shift& one : shifts) {
        f.push_back(one.frequency_hz);
        zeta.push_back(one.damping_ratio);
    }
    const both_ways of_f = judge(f, shares), of_zeta = judge(zeta, shares);
    if (!(of_f.evidence + of_zeta.evidence < strong_evidence)) return {};
    const auto factor = [](const both_ways& one) { return std::sqrt(std::max(1.0, one.by_length / one.by_energy)); };
    return {factor(of_f), factor(of_zeta)};
}

} // namespace okid_host
