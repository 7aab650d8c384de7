// SPDX-License-Identifier: MIT
// PURPOSE  files that are read whole: configs, DBCs, rigs
// METHOD   drv_input_open() refuses what is no file; the size is bounded before and while it is read
#pragma once
#include <cstddef>
#include <string>

namespace okid_host {

constexpr std::size_t largest_text = std::size_t{64} << 20; ///< a config of 65,536 channels has 8 MiB

/// Throws `failure` (exit 2): no such file, a folder, a device, a named pipe, too large. @param expected  "a CONFIG.toml"
std::string read_input(const std::string& path, const char* expected, std::size_t most = largest_text);

/// Its descriptor; throws as read_input() does.
int open_input(const std::string& path, const char* expected);

} // namespace okid_host
