// SPDX-License-Identifier: MIT
// Events to an MQTT broker: topic <prefix>/<title>/<type>. Only in builds with libmosquitto.
#pragma once
#include "config/config.hpp"
#include "publication.hpp"

namespace okid_host {

/// The title as one level of a topic: letters, digits, - and _; "okid" without a title.
std::string topic_level(const live_config& config);

/// A broker that is away is tried again and again by a thread of its own. Throws `failure` (exit 2) in a build without.
std::unique_ptr<event_sink> make_broker(const live_config& config);

} // namespace okid_host
