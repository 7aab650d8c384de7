// SPDX-License-Identifier: MIT
// The rig in real time, each sample at its own absolute moment: as frames on a CAN interface or as packets on a serial
// line.
#pragma once
#include "rig_run.hpp"

#include <string>

namespace okid_host {

/// Sends until the record ends or a signal comes. Throws `failure` (exit 4) when the target cannot be used.
/// @param baud  of a serial device
void play_rig(const rig_run& run, const std::string& target, int baud);

} // namespace okid_host
