// SPDX-License-Identifier: MIT
// Forces that rest: before they set in, and between hits.
#pragma once
#include "record.hpp"

namespace okid_host {

/// Where a pulse begins, and whether the force rests between its pulses.
struct force_level {
    double pulse = 0;
    bool rests = false;
};
force_level level_of(const double* force, std::size_t stride, std::size_t count);

/// A channel of a record less what it rests at.
std::vector<double> from_rest(const record_set& set, const record_data& record, std::size_t channel);

/// Does a force act in hits alone, each of one sign? @param force  less what it rests at, NaN: missing
bool acts_in_hits(const std::vector<double>& force);

/// Is a record silent before its force sets in?
bool begins_at_rest(const record_set& set, const record_data& record);

/// Do all records begin at rest? Asked for, or silent before the force sets in.
bool begin_at_rest(const record_set& set, const record_options& options);

/// A force that acts in hits alone is constant between them: what its channel says there is noise, and no input. Unless the
/// channel has no reach to zero frequency: then it says there how it comes back to rest. @return was there any to be put to rest?
bool rest_between_hits(record_set& set);

/// What follows each hit until the next one, outputs alone. Empty where a force acts otherwise than in hits.
record_set after_hits(const record_set& set);

} // namespace okid_host
