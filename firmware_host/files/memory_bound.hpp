// SPDX-License-Identifier: MIT
// PURPOSE  the memory that the samples of a record may take, known before any of it is taken
// METHOD   max_memory_mb = 8192, or what OKID_MAX_MEMORY_MB says; reading and identifying a record takes about four times
//          its samples, so these may have a quarter of it. tools/okid/data/memory.py does the same for Python
#pragma once
#include <cstddef>
#include <string>

namespace okid_host {

/// Are so many numbers of 8 bytes within it?
bool samples_fit(std::size_t rows, std::size_t columns);

/// Throws `failure` (exit 2) when they are not. @param path  of the record, for the message
void require_samples(const std::string& path, std::size_t rows, std::size_t columns);

} // namespace okid_host
