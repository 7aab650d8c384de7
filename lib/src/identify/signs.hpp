// SPDX-License-Identifier: MIT
// PURPOSE    draws of variance 1 that are the same on every machine: +1 and -1 by xorshift
#pragma once
#include <cstdint>

namespace okid {

struct signs {
    std::uint64_t state = 0x9E3779B97F4A7C15u;
    double operator()() {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        return (state >> 40 & 1) != 0 ? 1 : -1;
    }
};

} // namespace okid
