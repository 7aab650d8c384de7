// SPDX-License-Identifier: MIT
// Records made sample by sample for the judges of records: vibrations in narrow bands, and the modes listed for them.
#pragma once
#include "record/modal_model.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

namespace okid_host {

constexpr double sample_rate = 256;

using series = std::vector<double>;
using analytic = std::vector<std::complex<double>>;

/// The slow amplitude of a mode under white noise: complex, Gaussian, of mean square 1.
inline analytic chance_amplitude(std::size_t count, double frequency_hz, double damping_ratio, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const double keeps = std::exp(-2 * M_PI * frequency_hz * damping_ratio / sample_rate);
    const double driven = std::sqrt((1 - keeps * keeps) / 2);
    analytic out(count);
    std::complex<double> state = 0;
    for (std::size_t t = 0; t < count + 4096; ++t) {
        state = keeps * state + driven * std::complex<double>(normal(random), normal(random));
        if (t >= 4096) out[t - 4096] = state;
    }
    return out;
}

/// Of a structure that is struck at these samples: each hit adds its size, in between it rings down.
inline analytic struck(std::size_t count, double frequency_hz, double damping_ratio,
                       const std::vector<std::pair<std::size_t, double>>& hits) {
    analytic out(count);
    const double keeps = std::exp(-2 * M_PI * damping_ratio * frequency_hz / sample_rate);
    const double turn = 2 * M_PI * frequency_hz / sample_rate;
    std::complex<double> a = 0;
    auto next = hits.begin();
    for (std::size_t t = 0; t < count; ++t, a *= keeps) {
        for (; next != hits.end() && next->first == t; ++next)
            a += std::polar(next->second, -turn * static_cast<double>(t)); // the phase of all is that of the hit
        out[t] = a;
    }
    return out;
}

/// Every some seconds, of uneven sizes.
inline std::vector<std::pair<std::size_t, double>> hits_in(std::size_t count, unsigned seed) {
    std::vector<std::pair<std::size_t, double>> out;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> apart(3, 6), size(0.6, 1.4);
    for (double t = 1; t * sample_rate < static_cast<double>(count); t += apart(random))
        out.emplace_back(static_cast<std::size_t>(t * sample_rate), size(random));
    return out;
}

/// The vibration whose amplitude that is.
inline analytic turning_at(double frequency_hz, analytic amplitude) {
    for (std::size_t t = 0; t < amplitude.size(); ++t)
        amplitude[t] *= std::polar(1.0, 2 * M_PI * frequency_hz / sample_rate * static_cast<double>(t));
    return amplitude;
}

inline series white(std::size_t count, double sigma, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    series out(count);
    for (double& x : out) x = sigma * normal(random);
    return out;
}

/// out += factor x the real part.
inline void add(series& out, double factor, const analytic& of) {
    for (std::size_t t = 0; t < out.size(); ++t) out[t] += factor * of[t].real();
}

/// One record of these channels, so many of them forces.
inline record_set record_of(const std::vector<series>& channels, std::size_t forces = 0) {
    record_set out;
    out.n_u = forces;
    out.n_y = channels.size() - forces;
    series rows;
    for (std::size_t t = 0; t < channels[0].size(); ++t)
        for (const series& channel : channels) rows.push_back(channel[t]);
    out.add("made", rows.data(), channels[0].size());
    return out;
}

inline listed_mode mode_at(double frequency_hz, double damping_ratio, std::vector<std::complex<double>> shape = {1.0}) {
    return {frequency_hz, damping_ratio, 1, 1, std::move(shape), true};
}

inline mode_verdict verdict(std::vector<std::string> why = {}) {
    mode_verdict out;
    out.confident = why.empty();
    out.found_in = 1;
    out.why = std::move(why);
    return out;
}

/// What the record says with this code; empty: nothing.
inline std::string warning(const record_work& work, const std::string& code) {
    for (const auto& [its, text] : work.context.warnings)
        if (its == code) return text;
    return {};
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

} // namespace okid_host
