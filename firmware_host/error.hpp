// SPDX-License-Identifier: MIT
// What a command may end with: one clear message and the exit code of docs (0 done, 1 a change where one was asked for,
// 2 usage/input, 3 no reliable model, 4 device, 130 interrupted).
#pragma once
#include "files/shown_text.hpp"

#include <cstdio>
#include <fmt/format.h>
#include <stdexcept>
#include <string>
#include <utility>

namespace okid_host {

enum exit_code {
    exit_ok = 0,
    exit_changed = 1,
    exit_usage = 2,
    exit_no_model = 3,
    exit_device = 4,
    exit_interrupted = 130
};

/// Thrown anywhere in the host, caught once in main(): printed as "okid: <what>" on stderr, exits with `code`.
struct failure : std::runtime_error {
    failure(int exit_status, const std::string& what, int of_library = 0)
        : std::runtime_error(what), code(exit_status), status(of_library) {}
    int code;
    int status; ///< okid_status_t where the library found the fault, else 0
};

/// A line for people on stderr. One that cannot be written (a full disk, a terminal that hung up) ends nothing.
template <class... Parts> void say(fmt::format_string<Parts...> text, Parts&&... parts) {
    const std::string line = shown(fmt::format(text, std::forward<Parts>(parts)...));
    (void)std::fwrite(line.data(), 1, line.size(), stderr);
}

} // namespace okid_host
