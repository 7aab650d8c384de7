// SPDX-License-Identifier: MIT
// How far back a method may look in the records there are.
#pragma once
#include "record.hpp"

namespace okid_host {

/// Put p (okid) or the block rows (n4sid, records without inputs) into `config`, smaller than asked for where the records do not bear them, with
/// the remark. Throws `failure` (exit 3) when they bear no model at all.
void choose_horizon(const record_options& options, const record_set& set, const missing_count& missing,
                    okid_identify_config_t& config, result_context& context);

} // namespace okid_host
