// SPDX-License-Identifier: MIT
// PURPOSE  the step from one counter of few bits to another
#pragma once
#include <cstdint>

namespace okid_host {

/// Difference of two counters of `bits` bits, the short way round.
inline std::int64_t wrapped_step(std::uint64_t from, std::uint64_t to, unsigned bits) {
    const std::uint64_t range = std::uint64_t{1} << bits, step = (to - from) & (range - 1);
    return step < range / 2 ? static_cast<std::int64_t>(step)
                            : static_cast<std::int64_t>(step) - static_cast<std::int64_t>(range);
}

} // namespace okid_host
