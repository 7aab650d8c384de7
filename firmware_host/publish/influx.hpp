// SPDX-License-Identifier: MIT
// [publish] influx: lines for InfluxDB, Telegraf and what else reads its line protocol, to a file, by UDP or by HTTP.
#pragma once
#include "config/config.hpp"
#include "publication.hpp"

namespace okid_host {

/// @param live  a file loses lines rather than hold up a run; a replay waits
/// Throws `failure` when the address (exit 4), the token or the file (exit 2) is not available.
std::unique_ptr<event_sink> make_influx(const live_config& config, bool live);

} // namespace okid_host
