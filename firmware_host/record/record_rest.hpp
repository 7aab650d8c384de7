// SPDX-License-Identifier: MIT
// Records that begin in silence, before their force sets in.
#pragma once
#include "record.hpp"

namespace okid_host {

/// Is a record silent before its force sets in?
bool begins_at_rest(const record_set& set, const record_data& record);

/// Do all records begin at rest? Asked for, or silent before the force sets in.
bool begin_at_rest(const record_set& set, const record_options& options);

} // namespace okid_host
