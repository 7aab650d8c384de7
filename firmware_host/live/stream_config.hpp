// SPDX-License-Identifier: MIT
// What a stream of samples is and what is wanted of it: of a CONFIG.toml, or of a caller in another language.
#pragma once
#include "config/config.hpp"

#include <okid/accumulator.h>
#include <okid/identify.h>
#include <okid/watch.h>

#include <string>
#include <vector>

namespace okid_host {

struct stream_config {
    std::string where;                        ///< how messages begin: "frame.toml: [identification]: ", or ""
    std::vector<std::string> inputs, outputs; ///< names of the channels
    double rate_hz = 0;
    identification_config wanted;
    int max_order = 0;                         ///< 0 = the bound of the library
    okid_sample_t sample = OKID_SAMPLE_DOUBLE; ///< what is added
    bool saturated_missing = false;            ///< codes: a sample with one at full scale is missing
    bool bulk = false;                         ///< long calls of 16-bit codes go through an FFT (the same bits)
    bool states_only = false;                  ///< samples come as states to merge, none are added
    std::vector<double> scale, offset;         ///< of each channel: value = scale * sample + offset
    std::vector<int> hits;                     ///< where each record will be struck, in order; empty: one place
    mass_plan mass;                            ///< M, K and R with a result, when it wants them
    remarks said;                              ///< what was chosen for it: goes into the result

    std::size_t channels() const { return inputs.size() + outputs.size(); }
};

/// The force and response channels of a CONFIG.toml as the grid delivers them: raw numbers, exact codes where they fit.
/// A config that names no horizon gets the longest that fits its memory (fit_memory()).
stream_config stream_of(const live_config& config);

/// What the library identifies.
okid_identify_config_t identify_config_of(const stream_config& config);

/// Where the sums are kept: growing, window or fading. A window moves in whole blocks: about a twentieth of it, or one
/// update where that is finer.
okid_accumulator_config_t sums_config_of(const stream_config& config);

/// The watch over the model.
okid_watch_config_t watch_config_of(const stream_config& config);

} // namespace okid_host
