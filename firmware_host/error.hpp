// SPDX-License-Identifier: MIT
// What a command may end with: one clear message and the exit code of docs (0 done, 2 usage/input, 3 no honest model,
// 4 device, 130 interrupted).
#pragma once
#include <stdexcept>
#include <string>

namespace okid_host {

enum exit_code { exit_ok = 0, exit_usage = 2, exit_no_model = 3, exit_device = 4, exit_interrupted = 130 };

/// Thrown anywhere in the host, caught once in main(): printed as "okid: <what>" on stderr, exits with `code`.
struct failure : std::runtime_error {
    failure(int exit_status, const std::string& what) : std::runtime_error(what), code(exit_status) {}
    int code;
};

} // namespace okid_host
