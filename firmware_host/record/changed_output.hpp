// SPDX-License-Identifier: MIT
// An output that from some time on says another multiple of what it said before.
#pragma once
#include "record.hpp"

#include <optional>

namespace okid_host {

struct output_change {
    std::size_t output = 0;
    double at = 0;     ///< share of the samples before it, to an eighth
    double factor = 1; ///< of what the other outputs say it should be; -1: turned over
};

/// Of records without a force, three outputs or more and 500 samples an eighth; none: all say what they said before, or what changed
/// is no matter of one output alone.
/// Cost: 9 outputs^2 flop a sample.
std::optional<output_change> changed_output(const record_set& set);

/// The remark `output_changed`.
void remark_changed_output(const record_set& set, result_context& context);

} // namespace okid_host
