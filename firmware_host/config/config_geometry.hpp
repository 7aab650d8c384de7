// SPDX-License-Identifier: MIT
// [geometry]: where the degrees of freedom are, for the pictures of report and live page. okid itself only checks it.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"

namespace okid_host {

/// Throws `failure` (exit 2) for anything the pictures could not be made of.
void check_geometry(const toml::table& file, const live_config& config);

} // namespace okid_host
