// SPDX-License-Identifier: MIT
// Short gaps for the filters of lower rates: a lost sample would cost each of them all that it looks at.
#pragma once
#include "levels.hpp"

namespace okid_host {

/// Records whose short gaps hold what the samples around them tell: gaps of up to ten samples, fewer where there are many
/// channels. Their channels have no mean. Empty where there is nothing to bridge, or more than a tenth of the samples is missing so.
std::vector<sample_rows> bridge_gaps(const std::vector<sample_rows>& records, std::size_t m);

} // namespace okid_host
