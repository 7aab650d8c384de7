// SPDX-License-Identifier: MIT
// How much of a sliding window an update rests on, when that is left to the samples (window = "auto").
//
// Windows of several lengths end at the same newest sample; the sums of a short one are a part of those of a long one. A long
// window scatters less, but of a structure that moves it tells what was half its length ago. The longest is taken whose
// frequencies agree with those of every shorter one within what scatter explains (Lepskii 1990; Goldenshluger, Nemirovski 1997).
// A choice rests on the sums alone, not on the one before: left-out updates change nothing.
#pragma once
#include "blocks.hpp"
#include "stream_config.hpp"

#include <okid/identify.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

/// What an update rests on, and what stood against more.
struct window_choice {
    struct objection {
        std::int64_t shorter_rows = 0, longer_rows = 0; ///< windows that do not agree
        double shorter_hz = 0, longer_hz = 0,
               sigma_hz = 0; ///< of one mode; sigma of what scatter makes of the difference
    };
    std::int32_t first = 0;           ///< oldest slot that is used
    std::int64_t rows = 0;            ///< that are used
    std::optional<objection> against; ///< none: all of the window
};

/// Why it is not all of the window; "" where it is.
std::string window_reason(const window_choice& chosen, double rate_hz);

class window_chooser {
  public:
    static constexpr int slots = 160; ///< of the window, so that the shortest has some

    explicit window_chooser(const stream_config& config);
    /// Rows of the shortest window: four times as many as unknowns, and so many slots that it has deviations.
    static std::int64_t fewest_rows(const stream_config& config);

    /// Identify from longer and longer windows until one disagrees, then from the one that is chosen. @return status of its okid_identify_run()
    okid_status_t run(okid_accumulator_t* whole, okid_identify_t* by, live_blocks& blocks, okid_identified_t& model);
    const window_choice& chosen() const { return chosen_; }
    void reset() { chosen_ = {}; }

  private:
    /// A window and the modes it gives.
    struct look {
        std::int32_t first = 0;
        std::int64_t rows = 0;
        std::vector<mode_shift> modes;
        std::vector<double> sigma_hz; ///< of the modes; NaN: not to be relied on
        double freedom = 1;           ///< degrees of freedom of these
    };
    bool grow(const okid_accumulator_t* whole, look& to) const;
    void describe(okid_accumulator_t* whole, okid_identify_t* by, live_blocks& blocks, const okid_identified_t& model,
                  look& to) const;
    std::optional<window_choice::objection> disagreement(const look& shorter, const look& longer) const;

    std::int64_t fewest_rows_;
    window_choice chosen_;
};

} // namespace okid_host
