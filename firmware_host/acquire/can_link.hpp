// SPDX-License-Identifier: MIT
// Is a CAN interface as a measurement needs it? What is wrong, and the command that fixes it.
#pragma once
#include "config/config.hpp"

#include <drv/link.h>

#include <string>
#include <vector>

namespace okid_host {

struct link_finding {
    std::string found;
    std::string remedy;   ///< a command; "" = nothing to fix
    bool missing = false; ///< it stands in the way; else worth knowing
};

/// First what is in the way, then remarks; one finding that is neither says that all is well.
std::vector<link_finding> judge_link(const bus_config& bus, const drv_link_t& link);

} // namespace okid_host
