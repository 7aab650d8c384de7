// SPDX-License-Identifier: MIT
#pragma once
#include "error.hpp"

namespace okid_host {

/// A table that states no rate in okid's own way and whose head, first row or time is not as read_csv() has it: another program
/// may have written it.
struct foreign_table : failure {
    using failure::failure;
};

} // namespace okid_host
