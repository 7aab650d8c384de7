// SPDX-License-Identifier: MIT
// A session fed by live buses, until it is done, a signal comes or the bus has fallen silent after the asked duration.
#pragma once
#include "session.hpp"

namespace okid_host {

/// Opens every bus, runs and finishes the session. Throws `failure`: exit 4 for a bus, exit 3 without a model.
void capture(const live_config& config, const session_options& options);

} // namespace okid_host
