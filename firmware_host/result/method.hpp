// SPDX-License-Identifier: MIT
// The identification methods by the names people type.
#pragma once
#include <okid/identify.h>

#include <cstddef>
#include <string>
#include <vector>

namespace okid_host {

/// okid-era, okid-era-dc, n4sid-moesp, n4sid-cva, n4sid-ssarx: in the order of okid_method_t.
const std::vector<std::string>& method_names();

/// The method of records that has no model of an order (frequency/identify_lags.hpp): none of method_names().
constexpr const char* lag_method = "plscf";

/// Samples below which auto looks at no record of so many channels: ten for each unknown of ten block rows.
long long fewest_of_auto(std::size_t n_u, std::size_t n_y);

/// Of a name out of method_names().
okid_method_t method_of(const std::string& name);

/// A subspace method: it looks back `rows` samples and has no p.
bool is_subspace(okid_method_t method);

/// No observer: the past reaches `rows` samples back, not p. Subspace methods, and okid methods without inputs.
bool looks_back_rows(okid_method_t method, std::size_t n_u);

/// Block rows of the Hankel matrices where none are given (0).
int rows_used(okid_method_t method, std::size_t n_u, int p, int rows);

/// system, innovations, literal: in the order of okid_hankel_t.
const std::vector<std::string>& hankel_names();
okid_hankel_t hankel_of(const std::string& name);

/// Why `hankel` cannot be chosen with this method and so many inputs; empty when it can.
std::string hankel_fault(const std::string& hankel, const std::string& method, std::size_t n_u);

/// The option that decides how far a method looks back, with its value: "--p 40", "--rows 30".
std::string horizon_option(const okid_identify_config_t& config);

/// Unknowns of one output in the regression of the method, p or rows as in the config.
long long unknowns_of(okid_method_t method, int n_u, int n_y, int horizon);

} // namespace okid_host
