// SPDX-License-Identifier: MIT
// Units of sensors and what makes them SI.
#pragma once
#include <string>

namespace okid_host {

struct unit_rule {
    const char* name;
    double factor; ///< name = factor * si
    const char* si;
};

/// The rule for a unit as it is written in configs and headers; nullptr when it is not known.
const unit_rule* find_unit(const std::string& name);

/// The role that a unit tells: "force", "acceleration", "velocity", "displacement"; "" = none of those that are identified.
std::string role_of_unit(const std::string& unit);

} // namespace okid_host
