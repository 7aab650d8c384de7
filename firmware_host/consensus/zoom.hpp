// SPDX-License-Identifier: MIT
// A narrow band of a record as a stream of its own: what a horizon of so many samples cannot tell apart, one of a lower rate can.
//
// The band b fs/2 … (b + 1) fs/2 of the lower rate fs, behind a filter that keeps nothing else, is sampled at fs: its frequencies
// stand folded below fs/2, mirrored where b is odd. Poles keep their decay (R. G. Vaughan, N. L. Scott, D. R. White, The theory of
// bandpass sampling, 1991), and forces and responses are filtered alike, so that what lies between them stays the structure.
#pragma once
#include <complex>
#include <vector>

namespace okid_host {

/// Which band of the record's frequencies a stream holds.
struct zoom_band {
    double fs_hz = 0; ///< of the stream
    int number = 0;   ///< b; 0: from 0 Hz on, nothing is folded

    /// A frequency as the stream has it, and back. The same function: a mirror.
    double folded(double f_hz) const {
        return number % 2 ? (number + 1) * fs_hz / 2 - f_hz : f_hz - number * fs_hz / 2;
    }
    double unfolded(double f_hz) const {
        return number % 2 ? (number + 1) * fs_hz / 2 - f_hz : f_hz + number * fs_hz / 2;
    }
    /// Both numbers of a mode as the stream has it, and as the record has it: the decay stays.
    void fold(double& frequency_hz, double& damping_ratio) const;
    void unfold(double& frequency_hz, double& damping_ratio) const;
    /// A mirrored vibration turns the other way.
    std::complex<double> turned(std::complex<double> entry) const { return number % 2 ? std::conj(entry) : entry; }
};

} // namespace okid_host
