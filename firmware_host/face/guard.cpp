// SPDX-License-Identifier: MIT
// PURPOSE  the last error of each thread, and the number of the C interface
#include "guard.hpp"

#include <okid_host.h>

namespace okid_host::face {
namespace {

/// A fixed buffer: telling of a failed allocation must not allocate.
thread_local char last_error[8192];
thread_local int last_status = 0;

} // namespace

int keep_error(int code, const char* text, int status) noexcept {
    last_status = status;
    std::size_t n = 0;
    while (text[n] != '\0' && n + 1 < sizeof last_error) ++n;
    for (std::size_t i = 0; i < n; ++i) last_error[i] = text[i];
    while (n > 0 && (static_cast<unsigned char>(last_error[n]) & 0xC0U) == 0x80U && text[n] != '\0')
        --n; // whole letters
    last_error[n] = '\0';
    return code;
}

} // namespace okid_host::face

int32_t okid_host_abi(void) { return OKID_HOST_ABI; }

const char* okid_host_error(void) { return okid_host::face::last_error; }

int32_t okid_host_error_status(void) { return okid_host::face::last_status; }
