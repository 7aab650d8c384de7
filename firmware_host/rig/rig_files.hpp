// SPDX-License-Identifier: MIT
// What a simulated test leaves behind, beside the log: the truth, the record as CSV, the configuration for run and replay.
#pragma once
#include "rig_run.hpp"

#include <string>

namespace okid_host {

/// okid.truth/1; the structure after each [[change]] follows under "changes".
std::string rig_truth(const rig& rig);

/// The record in engineering units, exactly the values the log encodes.
std::string rig_csv(const rig_run& run);

/// A CONFIG.toml for `okid run` and `okid replay`; `dbc` as seen from its folder.
std::string rig_config(const rig& rig, const rig_run& run, const std::string& dbc);

/// The same for the rig as a node on a serial line.
std::string rig_line_config(const rig& rig, const rig_run& run, const std::string& device, int baud);

} // namespace okid_host
