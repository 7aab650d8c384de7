// SPDX-License-Identifier: MIT
// The rig's frames on a CAN interface in real time, each at its own absolute moment.
#pragma once
#include "rig_run.hpp"

#include <string>

namespace okid_host {

/// Sends until the record ends. Throws `failure`: exit 4 when the interface cannot be used, 2 for a serial device.
void play_rig(const rig_run& run, const std::string& interface);

} // namespace okid_host
