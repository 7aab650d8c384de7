// SPDX-License-Identifier: MIT
// PURPOSE  bounds that both the places of frames without a counter and the evidence for them rest on
#pragma once

#include <array>
#include <cstdint>

namespace okid_host {

inline constexpr double most_early = 0.5;         // periods; a frame that is earlier has the wrong place
inline constexpr double as_late = 0.3;            // periods
inline constexpr std::int64_t cut_off_bursts = 8; // and at least so many times something was handed over
inline constexpr double a_sample = 0.65;          // periods by which all are later when a sample is missing, at least
inline constexpr std::int64_t slip_apart = 2500;  // samples: clocks within 400 ppm slip past each other no more often
inline constexpr double newest = 0.5;             // of the decision time
inline constexpr std::array<double, 9> edges{0.2,  0.45, 0.65,  1.65, 2.65,
                                             4.65, 8.65, 16.65, 32.65}; // lateness, periods

} // namespace okid_host
