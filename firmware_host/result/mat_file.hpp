// SPDX-License-Identifier: MIT
// The state-space model as a MATLAB level 4 file, which scipy.io.loadmat and every MATLAB read.
#pragma once
#include <okid/identify.h>

#include <string>

namespace okid_host {

/// The bytes of a file with A, B, C, D, K and dt.
std::string mat_file(const okid_identified_t& model);

} // namespace okid_host
