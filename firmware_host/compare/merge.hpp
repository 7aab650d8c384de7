// SPDX-License-Identifier: MIT
// Results of set-ups of one structure as one result: PoSER merging, by modes.
#pragma once
#include "known_result.hpp"
#include "record/record.hpp"

#include <string>
#include <vector>

namespace okid_host {

/// One set of modes over all places, each named once; method "poser", without inputs, B and D. Throws `failure` (exit 2).
/// @param references  places that scale the shapes, which every result has; empty: all such
/// @param order  in which the places stand; others behind these, as they appear
record_result merge_results(const std::vector<known_result>& results, const std::vector<std::string>& references,
                            const std::vector<std::string>& order = {});

} // namespace okid_host
