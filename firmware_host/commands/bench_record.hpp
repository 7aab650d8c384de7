// SPDX-License-Identifier: MIT
// Records with known modes for okid bench: the three structures W1, W2, W3 of docs/numerics.md under white forces.
#pragma once
#include "rig/rig.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace okid_host {

struct bench_structure {
    const char* name;
    structure body;
    rig_modes truth;             ///< undamped frequencies; what damped poles have as |lambda|
    std::vector<int> force_dofs; ///< from 1; an accelerometer stands at every degree of freedom
};

/// Chains of 3, 6 and 10 masses, R = alpha M + beta K with 1 % at the first and the last mode.
const std::vector<bench_structure>& bench_structures();

struct bench_record {
    int n_u, n_y, order, samples;
    double rate_hz; ///< puts the highest mode at 0.6 Nyquist
    rig_modes truth;
    std::vector<double> v;           ///< (n_u + n_y) x samples, inputs, then outputs
    std::vector<std::int16_t> codes; ///< the same, each channel rounded to 16 bits
    std::vector<double> scale;       ///< v = scale code
};

/// White forces of unit variance held over the sample, Gaussian noise of so many percent of each output's rms.
bench_record make_record(const bench_structure& from, int samples, double noise_percent);

struct mode_error {
    double frequency, damping; ///< worst relative error of any mode; infinite where a mode is missing
};

/// A true mode is missing when none was found within 5 % of its frequency.
mode_error compare_modes(const rig_modes& truth, const double* frequency_hz, const double* damping_ratio, int count);

} // namespace okid_host
