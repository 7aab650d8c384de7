// SPDX-License-Identifier: MIT
// PURPOSE  standard deviations of ambient modes, not below the bound
// METHOD   the blocks of a record are few beside the bandwidth of a slow mode, so that their scatter may come out too small; a
//          mode under a steady random force is a narrow-band signal whose Fisher information is known in closed form
//          (Au, Mech. Syst. Signal Process. 48 (2014) 15-33; relative variances zeta/(4 pi f T) and 1/(2 pi zeta f T))
#include "ambient_bound.hpp"

#include <algorithm>
#include <cmath>

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

} // namespace

void keep_to_ambient_bound(const record_set& set, double fs_hz, const std::vector<listed_mode>& modes,
                           deviations& sigma) {
    double seconds = 0;
    for (const record_data& record : set.records) {
        const double samples = steady_samples(set, record);
        if (samples == 0) return;
        seconds += samples / fs_hz;
    }
    for (std::size_t k = 0; k < modes.size() && k < sigma.frequency_hz.size(); ++k) {
        const double f = modes[k].frequency_hz, zeta = modes[k].damping_ratio, radians = 2 * M_PI * f * seconds;
        if (!(zeta > 0)) continue;
        if (sigma.frequency_hz[k] < f * std::sqrt(zeta / (2 * radians)))
            sigma.frequency_hz[k] = f * std::sqrt(zeta / (2 * radians));
        if (sigma.damping_ratio[k] < std::sqrt(zeta / radians)) sigma.damping_ratio[k] = std::sqrt(zeta / radians);
    }
}

} // namespace okid_host
