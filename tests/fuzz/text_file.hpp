// SPDX-License-Identifier: MIT
// Bytes as a file with a name, in memory. A refusal by `failure` with a message is what bad input is answered with.
#pragma once
#include "error.hpp"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <sys/mman.h>
#include <unistd.h>

namespace okid_fuzz {

inline std::string file_of(const std::uint8_t* data, std::size_t size) {
    static const int file = memfd_create("input", 0);
    if (ftruncate(file, 0) != 0 || pwrite(file, data, size, 0) != static_cast<ssize_t>(size)) std::abort();
    return "/proc/self/fd/" + std::to_string(file);
}

template <typename Read> int expect_value_or_refusal(const Read& read) {
    try {
        read();
    } catch (const okid_host::failure& refusal) {
        if (refusal.code != okid_host::exit_usage || std::strlen(refusal.what()) == 0) std::abort();
    }
    return 0;
}

} // namespace okid_fuzz
