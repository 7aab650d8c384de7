// SPDX-License-Identifier: MIT
// What stands behind the handles of okid_host/files.h.
#pragma once
#include "config/config.hpp"

#include <string>

struct okid_host_config {
    okid_host::live_config config;
    std::string json;
};
