// SPDX-License-Identifier: MIT
// PURPOSE  which hold a record's forces have
// METHOD   the model's own response says held or not (result/hold.hpp), the spectrum of the forces tells linear from band-limited
#include "record_hold.hpp"

#include "consensus/spectrum.hpp"
#include "result/hold.hpp"

namespace okid_host {
namespace {

constexpr std::size_t hold_spectrum = 256;
constexpr double falling = 0.25; // power just below Nyquist over the usual: an anti-alias filter takes more away

} // namespace

bool falls_to_nyquist(const record_set& set) {
    const std::vector<std::vector<double>> rows = set.rows_of_each();
    for (std::size_t k = 0; k < set.n_u; ++k) {
        const std::vector<double> power = power_spectrum(rows, set.channels(), k, hold_spectrum);
        if (!power.empty() && mean_power(power, 0.47, 0.5) < falling * median_power(power, 0.1, 0.4)) return true;
    }
    return false;
}

std::string hold_of_data(const record_set& set, const okid_identified_t& model, const mass_plan& plan) {
    std::vector<int> sensing;
    for (const mass_channel& channel : plan.outputs) sensing.push_back(channel.sensing);
    return tell_hold(model, sensing, falls_to_nyquist(set));
}

} // namespace okid_host
