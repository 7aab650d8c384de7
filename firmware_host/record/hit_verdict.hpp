// SPDX-License-Identifier: MIT
// Is a hit accepted? One rule for a stream that waits for hits and for files that hold one each.
//
// It is refused, with the reason, when samples are missing, a channel was overloaded, the structure still moved, the force hardly
// exceeds its noise, there was a second hit, the force ends too late, or its spectrum ends too early.
// No exponential window is put on the response: a model needs none, and it would add damping.
#pragma once
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace okid_host {

/// A channel of a hit.
struct hit_channel {
    std::string name;
    bool force = false;
    std::string unit;                        ///< sensors of one unit are compared
    double scale = 1;                        ///< units a number
    bool complete = true;                    ///< a missing sample spoils the hit
    double low = -INFINITY, high = INFINITY; ///< limits of its code
};

/// The samples of one hit, and what is asked of it. Every row holds the channels first.
struct hit_window {
    const double* rows = nullptr;
    std::size_t count = 0, width = 0; ///< rows, numbers of a row
    std::size_t before = 0;           ///< rows before the force begins
    std::size_t fewest_before = 8;    ///< of these
    double rate_hz = 0;
    const std::vector<hit_channel>* channels = nullptr;
    std::size_t hammer = 0;       ///< the channel of the force
    double scale = 1, offset = 0; ///< of its numbers
    double sign = 1;              ///< of a hit
    std::string unit;             ///< of the force, with a blank before it
    double double_percent = 10;   ///< a second pulse beyond this share of the peak is a second hit
    double spectrum_hz = 0;       ///< the force has to reach it

    const double* at(std::size_t i) const { return rows + i * width; }
    double force(std::size_t i) const { return offset + scale * at(i)[hammer]; }
};

struct hit_verdict {
    std::string fault, text; ///< fault "" = accepted; text is for people
    std::string note;        ///< worth knowing, and no reason to refuse it; ""
    double peak = 0;         ///< in the unit of the force, with its sign
    double duration_s = 0;   ///< above 10 % of the peak
    double band_hz = 0;      ///< up to here the force has a tenth of its greatest spectral amplitude
    bool good() const { return fault.empty(); }
};

hit_verdict judge_hit(const hit_window& hit);

/// Where the force of a record acts that holds one hit.
struct hit_span {
    std::size_t begin = 0, end = 0; ///< first sample beyond 10 % of the peak, one past the last beyond 5 %
    double sign = 1;
    double free = 0; ///< share without force in what follows the beginning; 0: the force never rests
};

/// Of `count` samples, `stride` numbers apart; NaN is missing.
hit_span find_hit(const double* force, std::size_t count, std::size_t stride);

/// Where a record of several hits, each short beside the time to the next, is cut: shortly before each but the first. Pulses that
/// soon follow another are one hit. Empty: there is one, or the force never rests.
std::vector<std::size_t> find_cuts(const double* force, std::size_t count, std::size_t stride);

constexpr double least_free = 0.3; ///< of what follows the beginning of a hit

} // namespace okid_host
