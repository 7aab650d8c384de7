// SPDX-License-Identifier: MIT
// The amplitude of a vibration over time: at one frequency, block by block.
#pragma once
#include "result/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

namespace okid_host {

/// Adds to `out` the complex amplitude at a frequency, in shares of the rate, of every whole block of at(0) .. at(count - 1)
/// under a Hann window of mean 1; NaN where a sample is missing.
template <class At>
void demodulate(std::size_t count, double share, std::size_t block, const At& at,
                std::vector<std::complex<double>>& out) {
    if (block > count) return;
    std::vector<double> hann;
    for (std::size_t i = 0; i < block; ++i)
        hann.push_back((1 - std::cos(2 * M_PI * static_cast<double>(i) / static_cast<double>(block))) /
                       static_cast<double>(block));
    const std::complex<double> turn = std::polar(1.0, -2 * M_PI * share);
    std::complex<double> phase = 1;
    for (std::size_t first = 0; first + block <= count; first += block) {
        std::complex<double> sum = 0;
        for (std::size_t i = 0; i < block; ++i, phase *= turn) sum += hann[i] * at(first + i) * phase;
        phase /= std::abs(phase);
        out.push_back(sum);
    }
}

/// Does a vibration last, or does the record hold a single decay? (Sum of amplitudes)^2 over blocks times sum of squares:
/// chance gives 0.79, a decay less than a half. Blocks with a missing sample add nothing.
inline bool lasts(const std::vector<std::complex<double>>& amplitudes) {
    double sum = 0, squares = 0;
    for (const auto& x : amplitudes)
        if (const double size = std::abs(x); !std::isnan(size)) sum += size, squares += size * size;
    return sum * sum >= static_cast<double>(amplitudes.size()) * squares / 2;
}

/// Steps of an amplitude from block to block, loud ones count more: of a vibration under steady random forces, which looks the
/// same backwards in time, as many go down as up. One that is struck now and then rings down in between.
struct amplitude_steps {
    double down = 0, all = 0, squares = 0;

    /// @param unit  in which the amplitudes of this vibration count
    void add(const std::vector<std::complex<double>>& amplitudes, double unit = 1) {
        for (std::size_t i = 1; i < amplitudes.size(); ++i) {
            const double before = std::abs(amplitudes[i - 1]), after = std::abs(amplitudes[i]);
            const double weight = std::isnan(before + after) ? 0 : std::max(before, after) / unit;
            down += after < before ? weight : 0;
            all += weight;
            squares += weight * weight;
        }
    }
    [[nodiscard]] double excess() const { return all > 0 ? 2 * down / all - 1 : 0; } // by chance 1 / sqrt(steps)
    [[nodiscard]] bool of_hits() const {
        return excess() > judgement::falling && excess() * excess() * all * all > judgement::by_chance * squares;
    }
};

/// Is a vibration struck now and then? @param amplitudes  of short blocks
inline bool rings_down(const std::vector<std::complex<double>>& amplitudes) {
    amplitude_steps steps;
    steps.add(amplitudes);
    return steps.of_hits();
}

} // namespace okid_host
