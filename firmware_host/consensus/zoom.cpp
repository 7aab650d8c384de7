// SPDX-License-Identifier: MIT
#include "zoom.hpp"

#include <cmath>

namespace okid_host {
namespace {

/// The same decay at another damped frequency.
template <class Move> void move(double& frequency_hz, double& damping_ratio, Move to) {
    const double decay_hz = frequency_hz * damping_ratio;
    const double damped_hz = to(frequency_hz * std::sqrt(std::max(0.0, 1 - damping_ratio * damping_ratio)));
    frequency_hz = std::hypot(damped_hz, decay_hz);
    damping_ratio = decay_hz / frequency_hz;
}

} // namespace

void zoom_band::fold(double& frequency_hz, double& damping_ratio) const {
    if (number > 0) move(frequency_hz, damping_ratio, [this](double f) { return folded(f); });
}

void zoom_band::unfold(double& frequency_hz, double& damping_ratio) const {
    if (number > 0) move(frequency_hz, damping_ratio, [this](double f) { return unfolded(f); });
}

} // namespace okid_host
