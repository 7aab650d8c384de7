// SPDX-License-Identifier: MIT
// Short gaps: a lost sample would cost every row of lags, and of the filters of lower rates, that looks at it.
#pragma once
#include "levels.hpp"

namespace okid_host {

constexpr std::size_t longest_bridged = 10; ///< samples

/// The records (rows of m channels without a mean) with their short gaps filled from the samples around them: gaps of up to ten
/// samples, fewer where there are more than ten channels. Empty where no gap is short, where the short ones make up more than a
/// tenth of the rows, or where unbroken rows are too few to tell. Cost: O(m) a row without a gap, else O(40 m^2).
std::vector<sample_rows> bridge_gaps(const std::vector<sample_rows>& records, std::size_t m);

} // namespace okid_host
