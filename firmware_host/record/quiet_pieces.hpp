// SPDX-License-Identifier: MIT
// Of records without a force: what follows each time that something passed, or struck.
#pragma once
#include "record_set.hpp"

#include <string>
#include <utility>
#include <vector>

namespace okid_host {

/// From where the power of the outputs has fallen below its greatest (at once, if it rose at once: a release) to where it is least,
/// before it rises for the next time; each a record. No fall by `judgement::fall_of_power`: none.
record_set after_events(const record_set& set);

/// Code and words of a result that is of these pieces alone.
/// @param ratio  deviations over those of all. @param alone  modes that only all of it shows
std::pair<std::string, std::string> remark_pieces(const record_set& pieces, const record_set& all, double fs_hz,
                                                  double ratio, const std::vector<std::string>& alone);

} // namespace okid_host
