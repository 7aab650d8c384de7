// SPDX-License-Identifier: MIT
// The modal mass of a shape, from what a force does where a sensor stands beside it (a drive point).
#pragma once
#include "hold.hpp"

#include <cmath>
#include <complex>
#include <string>

namespace okid_host {

/// What one sample of a force adds to the state of a pole with residue 1, at the pole. @param hold  zoh, foh or band
inline std::complex<double> held_sample(std::complex<double> lambda, double dt, const std::string& hold) {
    const std::complex<double> mu = std::exp(lambda * dt);
    return hold == "band" ? mu * dt : held_force(lambda, mu, dt, hold);
}

/// Makes phi_o phi_i / m of a shape's entry at a sensor (displacement) times what one sample of a force does to the mode:
/// 2 j w_d r with the residue r. Normal modes at a drive point: real and above 0.
inline std::complex<double> drive_factor(std::complex<double> lambda, double dt, const std::string& hold) {
    return std::complex<double>(0, 2 * lambda.imag()) / held_sample(lambda, dt, hold);
}

/// Least squares over drive points: psi^2 / m = r.
struct drive_mass {
    std::complex<double> sum = 0;
    double power = 0;

    /// @param psi  of the shape whose mass is wanted, at the place. @param r  phi_o phi_i / m
    void add(std::complex<double> psi, std::complex<double> r) {
        sum += std::conj(psi * psi) * r;
        power += std::norm(psi * psi);
    }
    /// Its angle is that of the residues to those of a normal mode; not finite: no drive point.
    std::complex<double> complex_kg() const { return power / sum; }
    /// NaN: no drive point, or they contradict each other.
    double kg() const {
        const double mass = power / sum.real();
        return std::isfinite(mass) && mass > 0 ? mass : NAN;
    }
};

} // namespace okid_host
