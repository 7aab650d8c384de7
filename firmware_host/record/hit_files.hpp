// SPDX-License-Identifier: MIT
// Records that hold one hit each: which of them are used.
#pragma once
#include "record.hpp"

#include <vector>

namespace okid_host {

/// Does the force of most of them rest after a hit, or after each of several?
bool are_hits(const record_set& records);

/// A record of several hits becomes one record each, `places` with it.
void cut_at_hits(record_set& records, std::vector<int>& places);

/// Bad hits leave the records and `options.hits`, unless all are to be kept; what is to be said of them goes into
/// `options.said`. Throws `failure` (exit 3) where none is left.
/// @return every hit; empty: the force of most records never rests, they are no hits
std::vector<hit_line> choose_hits(record_set& records, record_options& options);

/// The number of the place in each file's name, as `--hit-dofs` has it. @param expression  with one group around
/// it, and perhaps one around its sign. Throws `failure` (exit 2).
std::string places_of_names(const std::string& expression, const std::vector<std::string>& paths);

} // namespace okid_host
