// SPDX-License-Identifier: MIT
// Events boiled down to the numbers a plot or a monitor wants.
#pragma once
#include "publication.hpp"

#include <cstdint>

namespace okid_host {

/// A number of an object, NaN where there is none.
double number_of(const nlohmann::ordered_json& object, const std::string& key);

/// The newest of everything. Losses and completeness come with the stats, about every five seconds.
struct live_numbers {
    struct mode {
        int track;
        double frequency_hz, damping_ratio, frequency_std_hz, damping_ratio_std;
        bool alarm;
    };
    double t = 0, wall_s = 0;
    std::int64_t samples = 0;
    bool settled = false, alarm = false;
    std::uint64_t alarms = 0, changes = 0, gaps = 0;
    std::vector<mode> modes; ///< tracked ones
    nlohmann::ordered_json bus = nlohmann::ordered_json::object(), channel = nlohmann::ordered_json::object();

    void take(const publication& one);
};

/// One line of JSON, flat: {"timestamp": …, "t": …, "mode1_frequency_hz": …, …}
std::string flat_json(const live_numbers& from);

} // namespace okid_host
