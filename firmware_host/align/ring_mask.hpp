// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>

namespace okid_host {

/// The mask of a ring with room for `least` entries: a power of two, 64 at least, less one.
inline std::size_t ring_mask(double least) {
    std::size_t size = 64;
    while (static_cast<double>(size) < least) size *= 2;
    return size - 1;
}

} // namespace okid_host
