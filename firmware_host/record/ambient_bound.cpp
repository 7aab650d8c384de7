// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of ambient modes, not below the bound
// METHOD   the blocks of a record are few beside the bandwidth of a slow mode, so that their scatter may come out too small; a
//          mode under a steady random force is a narrow-band signal whose Fisher information is known in closed form
//          (Au, Mech. Syst. Signal Process. 48 (2014) 15-33; relative variances zeta/(4 pi f T) and 1/(2 pi zeta f T))
#include "ambient_bound.hpp"

#include "consensus/demodulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

namespace okid_host {
namespace {

constexpr double steady = 4; ///< powers of the four quarters of a record within this factor

/// Complete samples of a steady record; 0 when it is none.
double steady_samples(const record_set& set, const record_data& record) {
    const std::size_t m = set.channels();
    double power[4] = {}, there[4] = {};
    std::vector<double> mean(m, 0.0);
    const auto complete = [&](std::size_t t) {
        const double* row = set.rows(record) + t * m;
        return std::all_of(row, row + m, [](double x) { return std::isfinite(x); });
    };
    for (int pass = 0; pass < 2; ++pass)
        for (std::size_t t = 0; t < record.count; ++t) {
            if (!complete(t)) continue;
            const double* row = set.rows(record) + t * m;
            const std::size_t quarter = 4 * t / record.count;
            if (pass == 0) ++there[quarter];
            const double all = there[0] + there[1] + there[2] + there[3];
            for (std::size_t k = 0; k < m; ++k) {
                if (pass == 0)
                    mean[k] += row[k];
                else
                    power[quarter] += (row[k] - mean[k] / all) * (row[k] - mean[k] / all);
            }
        }
    for (int k = 0; k < 4; ++k) power[k] /= std::max(there[k], 1.0);
    const auto [least, most] = std::minmax_element(power, power + 4);
    return *most < steady * *least ? there[0] + there[1] + there[2] + there[3] : 0;
}

/// A vibration along a mode's shape, without its mean; NaN where an output is missing.
std::vector<std::complex<double>> along(const record_set& set, const record_data& record, const listed_mode& mode) {
    std::vector<std::complex<double>> out(record.count);
    std::complex<double> mean = 0;
    double there = 0;
    for (std::size_t t = 0; t < record.count; ++t) {
        const double* row = set.rows(record) + t * set.channels();
        for (std::size_t k = 0; k < mode.shape.size(); ++k) out[t] += std::conj(mode.shape[k]) * row[k];
        if (!std::isnan(out[t].real())) mean += out[t], ++there;
    }
    for (auto& x : out) x -= mean / std::max(there, 1.0);
    return out;
}

/// Which modes ring down between hits: that tells more than a steady force does. One mode or all together show that there
/// are hits; beats hide them in blocks of one length and not in those of another.
std::vector<bool> ring_down(const record_set& set, double fs_hz, const std::vector<listed_mode>& modes) {
    std::vector<bool> out(modes.size());
    bool hits = false;
    std::array<amplitude_steps, 3> together;
    for (std::size_t k = 0; k < modes.size(); ++k) {
        const double f = modes[k].frequency_hz;
        std::array<std::vector<std::complex<double>>, together.size()> amplitudes;
        for (const record_data& record : set.records) {
            const auto signal = along(set, record, modes[k]);
            const auto at = [&](std::size_t t) { return signal[t]; };
            double periods = judgement::ring_periods;
            for (auto& of_length : amplitudes) {
                demodulate(record.count, f / fs_hz, static_cast<std::size_t>(periods * fs_hz / f) + 1, at, of_length);
                of_length.emplace_back(std::numeric_limits<double>::quiet_NaN()); // no step to the next record
                periods *= 2;
            }
        }
        for (std::size_t i = 0; i < together.size(); ++i) {
            amplitude_steps own;
            own.add(amplitudes[i]);
            if (own.excess() > judgement::falling) out[k] = true;
            hits = hits || (modes[k].in_model && own.of_hits());
            if (own.all > 0 && modes[k].in_model) together[i].add(amplitudes[i], std::sqrt(own.squares));
        }
    }
    for (const amplitude_steps& steps : together) hits = hits || steps.of_hits();
    return hits ? out : std::vector<bool>(modes.size());
}

} // namespace

void keep_to_ambient_bound(const record_set& set, double fs_hz, const std::vector<listed_mode>& modes,
                           const std::vector<widening>& wider, deviations& sigma) {
    double seconds = 0;
    bool throughout = true;
    for (const record_data& record : set.records) {
        const double samples = steady_samples(set, record);
        throughout = throughout && samples > 0;
        seconds += samples / fs_hz;
    }
    std::vector<bool> rings; // of no mode known until a deviation is to be raised
    for (std::size_t k = 0; k < modes.size() && k < sigma.frequency_hz.size(); ++k) {
        const double f = modes[k].frequency_hz, zeta = modes[k].damping_ratio;
        const widening by = k < wider.size() ? wider[k] : widening();
        const double radians = throughout && zeta > 0 ? 2 * M_PI * f * seconds : INFINITY;
        double &of_f = sigma.frequency_hz[k], &of_zeta = sigma.damping_ratio[k];
        const double least_f = std::max(f * std::sqrt(zeta / (2 * radians)), of_f * by.frequency),
                     least_zeta = std::max(std::sqrt(zeta / radians), of_zeta * by.damping);
        if (!(of_f < least_f) && !(of_zeta < least_zeta)) continue; // of NaN nothing is known
        if (rings.empty()) rings = ring_down(set, fs_hz, modes);
        if (rings[k]) continue;
        if (of_f < least_f) of_f = least_f;
        if (of_zeta < least_zeta) of_zeta = least_zeta;
        const double of_shape = std::sqrt(by.frequency * by.damping);
        const std::size_t n_y = modes[k].shape.size();
        for (std::vector<double>* each : {&sigma.shape_re, &sigma.shape_im})
            for (std::size_t i = k * n_y; i < (k + 1) * n_y && i < each->size(); ++i) (*each)[i] *= of_shape;
    }
}

} // namespace okid_host
