// SPDX-License-Identifier: MIT
// Frames of live buses to whatever wants them, until it is done, a signal comes or the bus has fallen silent after the
// asked duration; recorded on the way where that is wanted.
#pragma once
#include "journal/recorder.hpp"
#include "stream_target.hpp"

#include <optional>

namespace okid_host {

/// Opens every bus and runs; finishing the target is the caller's. Signals are caught already. Throws `failure`: exit 4
/// for a bus, exit 2 for a folder that cannot be recorded into.
void capture(const live_config& config, stream_target& target, const std::optional<double>& duration_s,
             const std::optional<recorder_options>& recording);

} // namespace okid_host
