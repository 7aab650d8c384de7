// SPDX-License-Identifier: MIT
// Times as people read them, and seconds that only go forward.
#pragma once
#include <cstdint>
#include <string>

namespace okid_host {

/// UTC of nanoseconds since 1970: 20261121T120000Z, or 2026-11-21T12:00:00.000000Z.
std::string utc_compact(std::int64_t time_ns);
std::string utc_text(std::int64_t time_ns);

/// Seconds of a clock that is never set.
double steady_s();

} // namespace okid_host
