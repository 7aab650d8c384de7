// SPDX-License-Identifier: MIT
// Tracks and runs written by hand, for the tests of what a consensus makes of them.
#pragma once
#include "consensus/consensus.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace okid_host {

using shape = std::vector<std::complex<double>>;
const shape bending = {1.0, 0.5, -0.4}, torsion = {1.0, -0.8, 0.6};

/// A pole that a run holds at all orders.
inline run_track track(double frequency_hz, double damping_ratio, const shape& of = bending, double emac = 1,
                       double mpc = 1) {
    run_track out;
    out.frequency_hz = frequency_hz;
    out.damping_ratio = damping_ratio;
    out.mpc = mpc;
    out.emac = emac;
    out.length = 10;
    out.shape = of;
    return out;
}

/// Runs of one rate, 100 samples a second, without tracks.
inline std::vector<consensus_run> rate(std::size_t count, int rows, int outputs = 3, int level = 0,
                                       double fs_hz = 100) {
    consensus_run run;
    run.method = OKID_METHOD_N4SID_CVA;
    run.level = level;
    run.fs_hz = fs_hz;
    run.rows = rows;
    run.outputs = outputs;
    run.top = 0.42;
    return std::vector<consensus_run>(count, run);
}

inline void give(std::vector<consensus_run>& runs, std::size_t first, std::size_t last, const run_track& found) {
    for (std::size_t r = first; r < last; ++r) runs[r].tracks.push_back(found);
}

inline bool has(const consensus_mode& mode, const char* code) {
    return std::find(mode.why.begin(), mode.why.end(), code) != mode.why.end();
}

} // namespace okid_host
