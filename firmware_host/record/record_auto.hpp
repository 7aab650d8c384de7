// SPDX-License-Identifier: MIT
// `--method auto`: the modes that several methods, horizons and rates agree on, and the modal model of them.
#pragma once
#include "record.hpp"

namespace okid_host {

/// Identify from all records together. Throws `failure`: exit 3 when no mode is confident.
/// @param before  what is known of samples before these; nullptr: these are all, and of too many the older ones are summed
record_result identify_auto(record_set records, const record_options& options, const older_samples* before);

} // namespace okid_host
