// SPDX-License-Identifier: MIT
// The same records at their own rate, half of it, a quarter …: no single rate suits all modes of a structure.
#pragma once
#include "level_memory.hpp"
#include "zoom.hpp"

#include <cstddef>
#include <vector>

namespace okid_host {

using sample_rows = std::vector<double>; ///< rows [u; y] of one record, n_u + n_y numbers a sample, NaN = missing

/// Every record at one rate, of one band.
struct record_level {
    double fs_hz = 0;
    double top = 0;    ///< modes above this share of fs_hz are not seen, …
    double bottom = 0; ///< … nor below this one, of a band that is folded
    int band = 0;      ///< zoom_band
    bool zoomed = false;
    zoom_band zoom() const { return {fs_hz, band}; }
    std::vector<sample_rows> records;
    long long samples = 0;               ///< complete ones, older ones with them
    const level_memory* older = nullptr; ///< sums of the samples before the records, in units of the channels
    std::vector<double> scale; ///< of each channel, where there are older ones: what one unit of the records is
};

constexpr std::size_t most_levels = 7;    ///< the record's own rate and six halves
constexpr long long fewest_samples = 700; ///< of a lower rate: fewer carry no run of any method

/// The weights of the linear-phase filter before a rate that is so many times lower.
std::vector<double> decimation_weights(int factor);

/// The records and their halves, while enough samples stay; each record centred, each channel scaled to unit spread.
/// @param decimate  the first rate is so many times lower than fs_hz
/// @param at_rest  the records begin in silence, which the filters are given too
/// @param scale    out, n_u + n_y: what one unit of a level is in the record
std::vector<record_level> make_levels(std::vector<sample_rows> records, std::size_t n_u, std::size_t n_y, double fs_hz,
                                      bool at_rest, int decimate, std::vector<double>& scale);

/// A stream of the first level's record that shows a frequency at a `factor`-th of its rate; no samples: it stands at the edge of
/// its band, where the filter is not flat, or too few samples are left.
record_level zoomed_level(const record_level& first, std::size_t m, int factor, double frequency_hz, bool at_rest);

} // namespace okid_host
