// SPDX-License-Identifier: MIT
// Of records without a force: what follows each time that something passed, or struck.
#pragma once
#include "record_set.hpp"

namespace okid_host {

/// From where the power of the outputs has fallen below its greatest to where it is least, before it rises for the next
/// time; each a record. Fewer than two, or no fall by `judgement::fall_of_power`: none.
record_set after_events(const record_set& set);

} // namespace okid_host
