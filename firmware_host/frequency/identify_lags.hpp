// SPDX-License-Identifier: MIT
// Records to modes by way of their sums: method plscf, and several set-ups of one structure identified together.
#pragma once
#include "record/record.hpp"

namespace okid_host {

/// What was measured before the sensors were moved: rows [u; y].
struct set_up {
    record_set set;
    std::vector<std::string> outputs;
};

/// From their correlations together (PreGER), method plscf. Throws `failure`.
/// @param references  outputs that stand in every set-up and scale the shapes; empty: all such
record_result identify_set_ups_together(std::vector<set_up> set_ups, const record_options& options,
                                        const std::vector<std::string>& references);

/// Method plscf, else identify_records().
record_result identify_by_method(record_set records, const record_options& options);

} // namespace okid_host
