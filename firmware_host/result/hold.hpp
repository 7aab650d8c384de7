// SPDX-License-Identifier: MIT
// What a force did between samples: held, linear, or band-limited as a load cell behind an anti-alias filter gives it.
#pragma once
#include <okid/identify.h>
#include <okid/mkr.h>

#include <complex>
#include <string>
#include <vector>

namespace okid_host {

/// The continuous pole of a mode, 1/s.
std::complex<double> continuous_pole(double frequency_hz, double damping_ratio);

/// What one sample of a force, held (zoh) or linear (foh), adds at z to the state of a pole with residue 1.
std::complex<double> held_force(std::complex<double> pole, std::complex<double> z, double dt, const std::string& hold);

/// How often a kind of sensor (okid_sensing_t) differentiates the displacement.
int times_differentiated(int kind);

/// What makes a displacement of an entry of a shape that such a sensor measured.
inline std::complex<double> to_displacement(std::complex<double> pole, int kind) {
    return std::pow(pole, -times_differentiated(kind));
}

/// How well continuous modes explain the response of a discrete model, when the force is taken to be so between samples.
struct hold_fit {
    double misfit = 1; ///< of the response in the band, relative
    double phase = 1;  ///< share of the residues out of phase: 0 for normal modes and the right hold
};
hold_fit fit_hold(const okid_identified_t& model, const std::vector<int>& sensing, const std::string& hold);

/// "zoh", "foh" or "band", found from the model and from whether the force's spectrum falls towards Nyquist.
std::string tell_hold(const okid_identified_t& model, const std::vector<int>& sensing, bool falls);

/// The same modes with B and D as a held force would have given them.
struct held_model {
    std::vector<double> A, B, C, D;
    okid_identified_t view{};
};

/// From a model identified under a band-limited force. @return false: no modes, or they do not explain its response
bool as_if_held(const okid_identified_t& model, const std::vector<int>& sensing, held_model& out);

} // namespace okid_host
