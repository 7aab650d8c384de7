// SPDX-License-Identifier: MIT
// A virtual rig: a structure with known M, K, R, its forces and sensors, as a RIG.toml describes it.
#pragma once
#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// M x'' + R x' + K x = B u (paper eq. 1).
struct structure {
    Eigen::MatrixXd M, K, R;
};

/// The structure from a moment on (a crack, a loosened bolt).
struct rig_change {
    double at_s = 0;
    structure after;
};

struct rig {
    std::string title = "virtual rig";
    double rate_hz = 0, duration_s = 0;
    std::uint64_t seed = 1;
    structure body;
    std::optional<double> alpha, beta;       ///< R = alpha M + beta K; absent when R was given
    std::vector<int> force_dofs, sense_dofs; ///< from 1
    std::string sensing = "acceleration", excitation = "white", hold = "zoh";
    double force_rms = 1, noise_percent = 0;
    int bits = 16;
    std::vector<rig_change> changes; ///< in order of time
    bool one_hit = false;            ///< of the hammer, at the beginning of the record

    std::size_t samples() const;
    std::vector<std::string> warnings; ///< of a rig that is legal but hard to identify
};

struct rig_modes {
    std::vector<double> frequency_hz, damping_ratio; ///< ascending in frequency
};

/// Read and check a RIG.toml. Throws `failure` (exit 2) naming line, key, found and expected.
rig load_rig(const std::string& path);

/// Chain of masses: spring i between mass i-1 (mass 0 is the ground) and mass i.
Eigen::MatrixXd chain_stiffness(const std::vector<double>& springs);

/// alpha and beta that give the first and the last mode these damping ratios (paper eq. 123-127).
std::pair<double, double> rayleigh_coefficients(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K, double first,
                                                double last);

/// Natural frequencies |lambda|/(2 pi) and damping ratios of the structure; empty when a mode does not oscillate or grows.
rig_modes structure_modes(const structure& body);

/// x_(n+1) = A x_n + B0 u_n + B1 u_(n+1), y_n = C x_n + D u_n, exact for a force held (B1 = 0) or linear between samples.
struct discrete_model {
    Eigen::MatrixXd A, B0, B1, C, D;
};

/// Exact discretisation by the matrix exponential (paper eq. 5-14). States: displacements, then velocities.
discrete_model discretise(const structure& body, const std::vector<int>& force_dofs, const std::vector<int>& sense_dofs,
                          const std::string& sensing, const std::string& hold, double rate_hz);

} // namespace okid_host
