// SPDX-License-Identifier: MIT
// The identification methods by the names people type.
#pragma once
#include <okid/identify.h>

#include <string>
#include <vector>

namespace okid_host {

/// okid-era, okid-era-dc, n4sid-moesp, n4sid-cva, n4sid-ssarx: in the order of okid_method_t.
const std::vector<std::string>& method_names();

/// Of a name out of method_names().
okid_method_t method_of(const std::string& name);

/// A subspace method: it looks back `rows` samples, has no p, and takes records without inputs.
bool is_subspace(okid_method_t method);

/// The option that decides how far a method looks back, with its value: "--p 40", "--rows 30".
std::string horizon_option(const okid_identify_config_t& config);

/// Unknowns of one output in the regression of the method, p or rows as in the config.
long long unknowns_of(okid_method_t method, int n_u, int n_y, int horizon);

} // namespace okid_host
