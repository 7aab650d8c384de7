// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of ambient modes where the power changes: storms, trains, nights
// METHOD   the jackknife takes a block's information for its share W of the energy, as it is where forces are known or a structure
//          rings down. Ambient vibration tells as much in a calm minute as in a stormy one: a block's own estimate varies by v,
//          whatever its W, and the whole, where the storm rules, by v sum W^2. With d = (1-W) (theta_j - theta) about the
//          median, E d^2 is v W^2 (1 - 2 W + min(W, sum W^2)) then, W (1-W) var theta by energies. The likelier of both, of frequency and damping
//          together; by energies only where the evidence is strong, because one storm alone says little of its own error
// REFERENCE Efron, Stein (1981); Busing, Meijer, van der Leeden (1999)
#include "uneven_blocks.hpp"

#include "files/order_statistics.hpp"

#include <algorithm>
#include <cmath>

namespace okid_host {
namespace {

constexpr double strong_evidence = 10; // twice the logarithm of a ratio of likelihoods

/// Of one quantity: variances of the whole, and twice the logarithm of how much likelier the one by energies is.
struct both_ways {
    double by_energy = 0, by_length = 0, evidence = 0;
};

both_ways judge(const std::vector<double>& moved, const std::vector<double>& shares) {
    const auto n = static_cast<double>(shares.size());
    const double centre = median(moved); // what a model without the storm has beyond linear terms shifts every mean
    double squares = 0;
    for (const double W : shares) squares += W * W;
    double energy_sum = 0, energy_unit = 0, length_sum = 0, length_unit = 0; // what is estimated: sums over sums
    double energy_mean = 0, energy_log = 0, length_mean = 0, length_log = 0; // what is likelier: every block alike
    for (std::size_t j = 0; j < shares.size(); ++j) {
        const double W = shares[j], d = (1 - W) * (moved[j] - centre), own = d * d / (W * W);
        const double energy = W * (1 - W), length = 1 - 2 * W + std::min(squares, W); // what all share is in the centre
        energy_sum += d * d;
        energy_unit += energy;
        length_sum += std::sqrt(W) * own; // a silent block says nothing
        length_unit += std::sqrt(W) * length;
        energy_mean += d * d / energy / n;
        energy_log += std::log(energy);
        length_mean += own / length / n;
        length_log += std::log(W * W * length);
    }
    return {energy_sum / energy_unit, squares * length_sum / length_unit,
            n * std::log(length_mean / energy_mean) + length_log - energy_log};
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
