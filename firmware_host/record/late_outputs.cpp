// SPDX-License-Identifier: MIT
// PURPOSE  delays of outputs beside each other from shapes alone; okid/steps/skew.h has those beside the forces
// METHOD   an entry of a real shape is a real number times e^(j (a_k - w_k tau_i)); by turns the angle a_k of each mode (in
//          closed form) and the delay tau_i of each output (on a grid, then a parabola), least squares of what is off the line
// NUMERICS angles are taken mod pi, so polarities do not matter; entries below three deviations say nothing
#include "late_outputs.hpp"

#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

using complex = std::complex<double>;

constexpr double least_deviation = 0.02; ///< of the largest entry: no real structure's shape is real to better
constexpr double clearly_there = 3;      ///< deviations of an entry
constexpr double surely_late = 4;        ///< deviations of a delay
constexpr int delay_steps = 200;         ///< steps over a period of the highest mode
constexpr int most_rounds = 60;
constexpr std::size_t most_late_named = 6;

/// Sums over the modes of a shape table.
struct delays {
    const std::vector<seen_shape>& modes;
    std::size_t outputs;
    double range;                ///< s
    std::vector<double> weights; ///< outputs x modes; 0: says nothing
    std::vector<double> angles;  ///< of the modes
    std::vector<double> tau;     ///< of the outputs

    explicit delays(const std::vector<seen_shape>& of)
        : modes(of), outputs(of.front().shape.size()), range(0), angles(of.size()), tau(outputs, 0.0) {
        for (const seen_shape& mode : modes) {
            range = std::max(range, mode.frequency_hz);
            for (std::size_t i = 0; i < outputs; ++i) {
                const double weight = 1 / (mode.variance[i] + least_deviation * least_deviation);
                weights.push_back(weight * std::norm(mode.shape[i]) > clearly_there * clearly_there ? weight
                                                                                                    : 0); // NaN: 0
            }
        }
        range = 0.5 / range;
    }
    double weight(std::size_t i, std::size_t k) const { return weights[k * outputs + i]; }
    double omega(std::size_t k) const { return 2 * M_PI * modes[k].frequency_hz; }
    /// An entry without the delay of its output.
    complex entry(std::size_t i, std::size_t k) const {
        return weight(i, k) == 0 ? 0 : modes[k].shape[i] * std::polar(1.0, omega(k) * tau[i]);
    }
    /// Turn each mode to the line that its entries lie along. @return sum of squares off it, over their variance
    double turn_modes() {
        double sum = 0;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            complex square = 0;
            for (std::size_t i = 0; i < outputs; ++i) square += weight(i, k) * entry(i, k) * entry(i, k);
            angles[k] = std::arg(square) / 2;
            for (std::size_t i = 0; i < outputs; ++i)
                sum += weight(i, k) * std::pow((entry(i, k) * std::polar(1.0, -angles[k])).imag(), 2);
        }
        return sum;
    }
    /// The delay of an output that brings it nearest to the lines of its modes.
    double best_delay(std::size_t i) const {
        std::vector<double> off(delay_steps + 1, 0.0);
        const double step = 2 * range / delay_steps;
        for (std::size_t k = 0; k < modes.size(); ++k) {
            if (weight(i, k) == 0) continue;
            complex at = modes[k].shape[i] * std::polar(1.0, -angles[k] - omega(k) * range);
            const complex on = std::polar(1.0, omega(k) * step);
            for (double& one : off) {
                one += weight(i, k) * at.imag() * at.imag();
                at *= on;
            }
        }
        const auto best = std::min_element(off.begin(), off.end());
        double out = step * static_cast<double>(best - off.begin()) - range;
        if (best == off.begin() || best + 1 == off.end()) return out;
        const double bend = best[-1] - 2 * best[0] + best[1];
        if (bend > 0) out += step * (best[-1] - best[1]) / (2 * bend);
        return out;
    }
    double deviation(std::size_t i) const {
        double sum = 0;
        for (std::size_t k = 0; k < modes.size(); ++k)
            sum += weight(i, k) == 0 ? 0 : weight(i, k) * std::norm(modes[k].shape[i]) * omega(k) * omega(k);
        return 1 / std::sqrt(sum);
    }
    bool spoken(std::size_t i) const { // of two modes at least
        int count = 0;
        for (std::size_t k = 0; k < modes.size(); ++k) count += weight(i, k) > 0;
        return count >= 2;
    }
};

} // namespace

std::vector<late_output> late_outputs(const std::vector<seen_shape>& modes) {
    if (modes.size() < judgement::fewest_modes_late || modes.front().shape.size() < 2) return {};
    delays found(modes);
    const double without = found.turn_modes();
    const auto entries = static_cast<double>(
        std::count_if(found.weights.begin(), found.weights.end(), [](double one) { return one > 0; }));
    const double free = entries - static_cast<double>(modes.size());
    const double left = free - static_cast<double>(found.outputs) + 1;
    if (left < 1 || without < judgement::complex_shapes * free) return {};
    double with = without;
    for (int turn = 0; turn < most_rounds; ++turn) {
        for (std::size_t i = 0; i < found.outputs; ++i) found.tau[i] = found.spoken(i) ? found.best_delay(i) : 0;
        const double before = with;
        with = found.turn_modes();
        if (std::abs(before - with) < 1e-6 * before) break;
    }
    if (with / left * judgement::explained_by_delays > without / free ||
        std::pow(with / without, left / 2) > judgement::delays_by_chance)
        return {};
    double earliest = INFINITY, least = 0;
    std::vector<double> deviation(found.outputs);
    for (std::size_t i = 0; i < found.outputs; ++i) {
        deviation[i] = found.spoken(i) ? found.deviation(i) * std::sqrt(std::max(1.0, with / left)) : INFINITY;
        if (found.spoken(i) && found.tau[i] < earliest) earliest = found.tau[i], least = deviation[i];
    }
    const auto is_late = [&](std::size_t i) {
        return found.tau[i] - earliest > surely_late * std::hypot(deviation[i], least);
    };
    double sum = 0, weight = 0; // of those that are not
    for (std::size_t i = 0; i < found.outputs; ++i) {
        if (is_late(i)) continue;
        sum += found.tau[i] / (deviation[i] * deviation[i]);
        weight += 1 / (deviation[i] * deviation[i]);
    }
    std::vector<late_output> late;
    for (std::size_t i = 0; i < found.outputs; ++i)
        if (is_late(i)) late.push_back({i, found.tau[i] - sum / weight, deviation[i]});
    return late;
}

std::string late_text(const std::vector<late_output>& late, const std::vector<std::string>& outputs) {
    std::string out;
    for (std::size_t n = 0; n < std::min(late.size(), most_late_named); ++n)
        out += fmt::format("{}{} {:.3g} ms", n == 0 ? "" : ", ", outputs[late[n].output], 1e3 * late[n].seconds);
    if (late.size() > most_late_named) out += fmt::format(" and {} more", late.size() - most_late_named);
    return out;
}

} // namespace okid_host
